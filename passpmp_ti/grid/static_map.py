"""Surfaces that are known to stay: an occupancy map, as map_server writes it or drawn from lines."""

from __future__ import annotations

import gzip
import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml
from scipy.ndimage import distance_transform_edt

from passpmp_ti import door

KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")


@dataclass(frozen=True, slots=True, eq=False)
class StaticMap:
    """Which cells of a fixed grid hold something that never moves.

    Unknown cells count as empty: calling a surface static is what must be earned, since nothing
    is expected to come out of it.
    """

    occupied: np.ndarray
    """[J, I] bool; row 0 is the lowest y of the map's own frame."""
    resolution: float
    """Side of a cell [m]."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """World (x, y, yaw) of the outer corner of cell [0, 0] [m, m, rad]."""
    _dilated: dict[float, np.ndarray] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        occupied = np.array(self.occupied)
        if occupied.ndim != 2 or not occupied.size or occupied.dtype != np.bool_:
            raise ValueError(
                "StaticMap.occupied must be bool of shape (J, I), J and I >= 1;"
                f" got {occupied.dtype} {occupied.shape}"
            )
        occupied.setflags(write=False)
        set_ = object.__setattr__
        set_(self, "occupied", occupied)
        resolution = door.finite("StaticMap", "resolution", self.resolution, above=0.0, unit="m")
        set_(self, "resolution", resolution)
        x, y, yaw = door.array("StaticMap", "origin", self.origin, (3,))
        set_(self, "origin", (float(x), float(y), float(yaw)))

    @classmethod
    def load(cls, path: str | Path) -> StaticMap:
        """Read a map_server pair: a YAML file and the PGM or PNG image it names.

        An image may be gzipped. Colours are averaged; a pixel less than half opaque is unknown.

        Args:
            path: the YAML file.

        Raises:
            ValueError: the file, the key and the rule that is broken.
        """
        path = Path(path)
        keys = _read_keys(path)
        grey, opaque = _read_image(_find_image(path, keys["image"]))
        darkness = grey if keys["negate"] else 1.0 - grey
        occupied = (darkness > keys["occupied_thresh"]) & opaque
        return cls(occupied[::-1], keys["resolution"], keys["origin"])

    @classmethod
    def from_segments(
        cls, segments: np.ndarray, resolution: float = 0.05, thickness: float = 0.0
    ) -> StaticMap:
        """Draw wall lines into a map that just holds them.

        Args:
            segments: [n, 4] x1, y1, x2, y2 [m], n >= 1.
            resolution: side of a cell [m].
            thickness: of the walls [m]; 0: the cells that the lines pass through.

        Raises:
            ValueError: no segments, wrong shape, not finite, resolution not > 0.
        """
        owner = "StaticMap.from_segments"
        lines = door.array(owner, "segments", segments, (None, 4))
        door.finite(owner, "resolution", resolution, above=0.0, unit="m")
        door.finite(owner, "thickness", thickness, least=0.0, unit="m")
        if not len(lines):
            raise ValueError(f"{owner}.segments is empty; a map needs at least one wall")
        ends = lines.reshape(-1, 2)
        margin = resolution + thickness
        low = np.floor((ends.min(axis=0) - margin) / resolution) * resolution
        i_count, j_count = np.ceil((ends.max(axis=0) + margin - low) / resolution).astype(int)
        occupied = np.zeros((j_count, i_count), dtype=bool)
        for x1, y1, x2, y2 in lines:
            # steps of a quarter cell miss no more than a cell's clipped corner
            count = math.ceil(4 * math.hypot(x2 - x1, y2 - y1) / resolution) + 2
            i = np.floor((np.linspace(x1, x2, count) - low[0]) / resolution).astype(int)
            j = np.floor((np.linspace(y1, y2, count) - low[1]) / resolution).astype(int)
            occupied[j, i] = True
        drawn = cls(occupied, resolution, (float(low[0]), float(low[1]), 0.0))
        return drawn if thickness == 0 else cls(
            drawn.dilated(thickness / 2), resolution, drawn.origin
        )

    def cells(self, points: np.ndarray) -> np.ndarray:
        """[n, 2] cell (j, i) of world points [n, 2] [m]; outside the map: beyond its shape."""
        x, y, yaw = self.origin
        d = np.asarray(points, dtype=np.float64) - (x, y)
        c, s = math.cos(yaw), math.sin(yaw)
        own = np.stack([c * d[..., 0] + s * d[..., 1], c * d[..., 1] - s * d[..., 0]], axis=-1)
        return np.floor(own[..., ::-1] / self.resolution).astype(np.int64)

    def contains(self, points: np.ndarray, tolerance: float = 0.0) -> np.ndarray:
        """Whether each point is within `tolerance` of an occupied cell.

        True is never said of a point that is further away; within one cell of the limit a point
        may be missed, which only takes a known surface for one that may move.

        Args:
            points: [n, 2] world [m].
            tolerance: [m], >= 0.

        Returns:
            [n] bool.
        """
        points = door.array("StaticMap.contains", "points", points, (None, 2))
        grown = self.dilated(tolerance)
        j, i = self.cells(points).T
        inside = (j >= 0) & (i >= 0) & (j < grown.shape[0]) & (i < grown.shape[1])
        found = np.zeros(len(points), dtype=bool)
        found[inside] = grown[j[inside], i[inside]]
        return found

    def dilated(self, tolerance: float) -> np.ndarray:
        """[J, I] bool, read-only: cells all of which is within `tolerance` [m] of an occupied cell.

        Centres at most `tolerance` apart bound every point of the one cell against the whole
        square of the other: both squares have the same half side, so it cancels.
        """
        tolerance = door.finite("StaticMap.dilated", "tolerance", tolerance, least=0.0, unit="m")
        if tolerance not in self._dilated:
            if self.occupied.any():
                distance = distance_transform_edt(~self.occupied, sampling=self.resolution)
                grown = distance <= tolerance
            else:
                grown = np.zeros_like(self.occupied)
            grown.setflags(write=False)
            self._dilated[tolerance] = grown
        return self._dilated[tolerance]

    def segments(self) -> np.ndarray:
        """[n, 4] outline of the occupied cells as world line segments x1, y1, x2, y2 [m]."""
        across = _runs(self.occupied)  # (row edge, first column, last column)
        along = _runs(self.occupied.T)
        own = np.concatenate([
            np.stack([across[:, 1], across[:, 0], across[:, 2], across[:, 0]], axis=1),
            np.stack([along[:, 0], along[:, 1], along[:, 0], along[:, 2]], axis=1),
        ]) * self.resolution
        x, y, yaw = self.origin
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, s], [-s, c]])
        return (own.reshape(-1, 2) @ turn + (x, y)).reshape(-1, 4)


def _runs(occupied: np.ndarray) -> np.ndarray:
    """[n, 3] unbroken edges between occupied and free rows: edge row, first and last column."""
    padded = np.pad(occupied, ((1, 1), (0, 0)))
    edge = padded[1:] != padded[:-1]
    # an edge also ends where the occupied side changes, so that outlines stay outlines
    side = np.where(edge, np.where(padded[1:], 1, 2), 0)
    walled = np.pad(side, ((0, 0), (1, 1)))
    changes = walled[:, 1:] != walled[:, :-1]
    found = []
    for row in np.flatnonzero(edge.any(axis=1)):
        cuts = np.flatnonzero(changes[row])
        for first, last in zip(cuts[:-1], cuts[1:], strict=True):
            if side[row, first]:
                found.append((row, first, last))
    return np.array(found, dtype=np.float64).reshape(-1, 3)


def _read_keys(path: Path) -> dict:
    """The YAML half of a map, every key checked."""
    try:
        given = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as cause:
        raise ValueError(f"{path}: cannot be read ({cause.strerror}); give a map's YAML") from cause
    except (yaml.YAMLError, UnicodeDecodeError) as cause:
        raise ValueError(f"{path}: not YAML: {cause}") from cause
    if not isinstance(given, dict):
        raise ValueError(f"{path}: must be a mapping with {', '.join(KEYS)}; got {given!r}")
    for key in given:
        if key not in KEYS:
            raise ValueError(
                f"{path}: unknown key {key!r}{door.nearest(key, KEYS)}; allowed: {', '.join(KEYS)}"
            )
    for key in ("image", "resolution", "origin"):
        if key not in given:
            raise ValueError(f"{path}: {key} is missing; a map needs image, resolution and origin")
    if not isinstance(given["image"], str):
        raise ValueError(f"{path}: image must be a file name; got {given['image']!r}")
    if given.get("negate", 0) not in (0, 1):
        raise ValueError(f"{path}: negate must be 0 or 1; got {given['negate']!r}")
    if given.get("mode", "trinary") != "trinary":
        raise ValueError(
            f"{path}: mode must be 'trinary'; got {given['mode']!r}; a cell here is either known"
            " to stay or not, so convert scale and raw maps first"
        )
    owner = str(path)
    keys = {"image": given["image"], "negate": bool(given.get("negate", 0))}
    keys["resolution"] = door.finite(owner, "resolution", given["resolution"], above=0.0, unit="m")
    for key, usual in (("occupied_thresh", 0.65), ("free_thresh", 0.196)):
        keys[key] = door.finite(owner, key, given.get(key, usual), least=0.0, most=1.0)
    if keys["free_thresh"] > keys["occupied_thresh"]:
        raise ValueError(
            f"{path}: free_thresh = {keys['free_thresh']:g} must be <= occupied_thresh ="
            f" {keys['occupied_thresh']:g}"
        )
    keys["origin"] = tuple(door.array(owner, "origin", given["origin"], (3,)))
    return keys


def _find_image(path: Path, name: str) -> Path:
    """The image beside its YAML, itself or gzipped."""
    for candidate in (path.parent / name, path.parent / f"{name}.gz"):
        if candidate.is_file():
            return candidate
    raise ValueError(f"{path}: image = {name!r}: no such file beside it, nor {name + '.gz'!r}")


def _read_image(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Brightness in [0, 1] and whether each pixel is opaque, [J, I], top row first."""
    try:
        data = path.read_bytes()
        if path.suffix == ".gz":
            data = gzip.decompress(data)
    except (OSError, EOFError) as cause:
        raise ValueError(f"{path}: cannot be read: {cause}") from cause
    if data[:2] in (b"P2", b"P5"):
        grey = _read_pgm(path, data)
        return grey, np.ones(grey.shape, dtype=bool)
    import cv2  # only here: a PGM map needs no OpenCV

    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"{path}: must be a PGM (P2, P5) or PNG image")
    levels = image.reshape(*image.shape[:2], -1) / float(np.iinfo(image.dtype).max)
    if levels.shape[2] in (2, 4):
        return levels[:, :, :-1].mean(axis=2), levels[:, :, -1] >= 0.5
    return levels.mean(axis=2), np.ones(levels.shape[:2], dtype=bool)


def _read_pgm(path: Path, data: bytes) -> np.ndarray:
    """[J, I] brightness in [0, 1] of a plain or binary PGM."""
    header: list[int] = []
    at = 2
    while len(header) < 3:
        while data[at : at + 1].isspace():
            at += 1
        if data[at : at + 1] == b"#":
            at = data.find(b"\n", at)
            at = len(data) if at < 0 else at
            continue
        end = at
        while data[end : end + 1].isdigit():
            end += 1
        if end == at:
            raise ValueError(f"{path}: PGM header must hold width, height and greatest value")
        header.append(int(data[at:end]))
        at = end
    width, height, most = header
    if not (width > 0 and height > 0 and 0 < most < 65536):
        raise ValueError(f"{path}: PGM header {header}: sizes must be > 0, values 1 to 65535")
    if data[:2] == b"P2":
        try:
            text = b"\n".join(line.split(b"#")[0] for line in data[at:].split(b"\n"))
            values = np.array(text.split(), dtype=np.int64)
        except (ValueError, OverflowError) as cause:
            raise ValueError(f"{path}: PGM values must be whole numbers") from cause
    else:
        kind = np.dtype(np.uint8 if most < 256 else ">u2")
        body = data[at + 1 :]
        values = np.frombuffer(body[: len(body) // kind.itemsize * kind.itemsize], dtype=kind)
    if len(values) < width * height:
        raise ValueError(
            f"{path}: PGM of {width} x {height} must hold {width * height} values;"
            f" got {len(values)}: the file is cut short"
        )
    return values[: width * height].reshape(height, width) / float(most)
