"""Occupancy maps as map_server writes them: a YAML file and the PGM or PNG image it names."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from passpmp_ti import door

KEYS = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")


def read_map(path: Path) -> tuple[np.ndarray, float, tuple[float, float, float]]:
    """What a map's files say.

    Returns:
        Occupied cells [J, I] bool with row 0 the lowest y, their side [m], and the (x, y, yaw) of
        the outer corner of cell [0, 0] [m, m, rad].

    Raises:
        ValueError: the file, the key and the rule that is broken.
    """
    keys = _read_keys(path)
    grey, opaque = _read_image(_find_image(path, keys["image"]))
    darkness = grey if keys["negate"] else 1.0 - grey
    occupied = (darkness > keys["occupied_thresh"]) & opaque
    return occupied[::-1], keys["resolution"], keys["origin"]


def _read_keys(path: Path) -> dict[str, Any]:
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
    keys: dict[str, Any] = {"image": given["image"], "negate": bool(given.get("negate", 0))}
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
    most = 255.0 if image.dtype == np.uint8 else 65535.0
    levels = image.reshape(*image.shape[:2], -1) / most
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
