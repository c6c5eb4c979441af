"""Probability layers: a forecast of tracked objects, rasterised about a robot's disc (eq. 15)."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti import device, door
from passpmp_ti.grid.stretches import LEFT_OUT, Forecast, Parts, Reach, cut
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.chances import CHANNELS, MOST_POINTS, SCRATCH, rasterise_windows
from passpmp_ti.kernels.risk import layer_chances
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings, integration_margin

TICK = 1e-3
"""[s]"""
SAMPLE = 0.05
"""Length of a sample of a motion, if the time step is no longer [s]."""
FINE = 0.6
"""Between two nodes of a window [standard deviations]."""
WIDE = 4.5
"""How far beyond the disc a window's nodes reach [standard deviations]."""
MOST_NODES = 4_000_000
"""Nodes of all windows of one forecast: 96 MB."""
WORKERS = 256
RING_ERROR = 1e-3
"""Bound on the relative error of the integrals over a ring, see `points_of`."""
ROUNDING = 1e-4
"""Relative, of the sums in single precision."""


@dataclass(frozen=True, slots=True, eq=False)
class Chances:
    """How likely tracked and hidden objects touch one robot; what kernels/risk.py reads.

    For how the arrays are laid out see kernels/chances.py.
    """

    forecast: Forecast
    robot: Robot
    settings: Settings
    position: tuple[float, float]
    stamp: float
    base_ticks: int
    anchor: tuple[float, float]
    emergence: float
    hidden_speeds: tuple[float, ...]
    extra: float
    """By how much more than the body's discs are grown [m]."""
    rows: device.Array
    places: device.Array
    slots: device.Array
    near: device.Array
    pool: device.Array
    odds: device.Array
    tally: device.Array
    _grown: dict[float, Chances] = field(default_factory=dict, repr=False)

    @property
    def arrays(self) -> tuple[device.Array, ...]:
        """What the kernels take, in their order."""
        return self.rows, self.places, self.slots, self.near, self.pool, self.odds, self.tally

    @property
    def nodes(self) -> int:
        """Nodes of all windows; each takes 24 bytes."""
        return self.pool.shape[0] // CHANNELS

    def layer(self, window: Window, ticks: device.Array, begin: float, end: float) -> np.ndarray:
        """Bound on the chance that anything touches a robot disc in each cell during [begin, end).

        Args:
            window: where the cells lie; anchored as this is.
            ticks: [J, I] uint16 of the model of the future.
            begin: absolute [s], as `end`; not before the scan.

        Returns:
            [J, I] float32: for a disc that stays where it is, anywhere in the cell.
        """
        if window.anchor != self.anchor:
            raise ValueError(
                f"Chances.layer: window.anchor = {window.anchor} is not that of the chances,"
                f" {self.anchor}; make them for this window"
            )
        door.finite("Chances.layer", "begin", begin, least=self.stamp - 1e-9, unit="s")
        door.finite("Chances.layer", "end", end, above=begin, unit="s")
        grown = self._about_cells(window.cell)
        chances = np.zeros((window.size, window.size), dtype=np.float32)
        layer_chances(
            ticks, *grown.arrays, *window.corner, float(window.cell),
            begin / TICK - self.base_ticks, end / TICK - self.base_ticks,
            math.ceil((end - begin) / sample_steps(self.settings) / self.settings.time_step),
            chances,
        )  # fmt: skip
        return chances

    def _about_cells(self, cell: float) -> Chances:
        """The same for discs that are centred anywhere in a cell; made once."""
        if cell not in self._grown:
            self._grown[cell] = chances_of(
                self.forecast, self.robot, self.settings, self.position, self.stamp,
                self.base_ticks, self.anchor, emergence=self.emergence,
                hidden_speeds=self.hidden_speeds, extra=self.extra + math.sqrt(0.5) * cell,
            )  # fmt: skip
        return self._grown[cell]


@functools.lru_cache(maxsize=2)
def no_chances(resident: bool) -> tuple[device.Array, ...]:
    """What the kernels take where no risk is weighed; `resident` as `device.resident` tells."""
    shapes = (((1, 22), np.float32), ((1, 4), np.int32), ((1, 2), np.int32), ((1, 3), np.float32))
    return (
        *(device.full(shape, 0, kind) for shape, kind in shapes),
        *(device.full(shape, 0, kind) for shape, kind in (((1,), np.float32), ((16,), np.float32))),
        device.full((5,), 0, np.int32),
    )


def chances_of(
    forecast: Forecast,
    robot: Robot,
    settings: Settings,
    position: tuple[float, float],
    stamp: float,
    base_ticks: int,
    anchor: tuple[float, float],
    *,
    emergence: float = 1.0,
    hidden_speeds: Sequence[float] = (1.0,),
    extra: float = 0.0,
) -> Chances:
    """Rasterise a forecast, where the robot can get to in time.

    Args:
        forecast: of the tracked objects.
        robot: whose discs they may touch.
        settings: margins and time step.
        position: of the robot at `stamp`, in the world [m].
        stamp: of the scan [s].
        base_ticks: from which ticks count [ms].
        anchor: from which places count [m].
        emergence: chance that something comes out of what is hidden.
        hidden_speeds: equally likely speeds of it, as shares of `Settings.object_speed`.
        extra: added to the discs' radii [m].

    Raises:
        ValueError: a forecast that is no forecast, chances outside [0, 1], or more windows than
            memory is allowed for.
    """
    emergence = door.finite("chances_of", "emergence", emergence, least=0.0, most=1.0)
    speeds = door.array("chances_of", "hidden_speeds", hidden_speeds, (None,))
    if not len(speeds) or speeds.min() < 0 or speeds.max() > 1:
        raise ValueError(
            f"chances_of.hidden_speeds = {tuple(hidden_speeds)}: one share of the bound at least,"
            " each between 0 and 1"
        )
    span = sample_steps(settings) * settings.time_step
    radius = body_radius(robot, settings, span) + extra + forecast.radius
    parts = cut(forecast, radius, Reach.of(robot, position, stamp, span), anchor)
    objects, components = forecast.weight.shape
    stretches = len(forecast.times) - 1
    layer_ticks = (forecast.times[-1] - forecast.times[0]) / stretches / TICK
    odds = np.zeros(16 + len(speeds), dtype=np.float32)
    odds[:7] = (
        forecast.times[0] / TICK - base_ticks, 1 / layer_ticks, LEFT_OUT, span, parts.left_out,
        emergence, math.ceil(stamp / TICK - base_ticks - 1e-6),
    )  # fmt: skip
    odds[16:] = speeds
    tally = np.array(
        [objects, components, stretches, len(speeds), sample_steps(settings)], dtype=np.int32
    )
    rows, places, pool = rasterised(parts)
    return Chances(
        forecast, robot, settings, (position[0], position[1]), stamp, base_ticks, anchor, emergence,
        tuple(float(s) for s in speeds), extra, rows, places, device.put(parts.slots),
        device.put(parts.near), pool, device.put(odds), device.put(tally),
    )  # fmt: skip


def sample_steps(settings: Settings) -> int:
    """Time steps from one sample of a motion to the next."""
    return max(1, round(SAMPLE / settings.time_step))


def body_radius(robot: Robot, settings: Settings, span: float) -> float:
    """Radius within which anything touches a disc that moves straight between samples [m].

    The margins of `Settings.clearance`, but for the motion between looks: here a disc is looked at
    every `span` seconds, and taken to move straight for half of that to either side.
    """
    return (
        robot.disc_radius
        + settings.tracking_error
        + 2 * settings.localisation_error
        + robot.top_acceleration * span**2 / 8
        + integration_margin(robot, settings.time_step)
    )


def points_of(sharpness: np.ndarray) -> np.ndarray:
    """How many points of a ring keep the trapezoidal rule's relative error below `RING_ERROR`.

    About a mean at the distance D the density along a ring of radius R is exp(k cos), k = R D / s^2
    at most: the rule's error is about 2 exp(-N^2 / 2 k) of the integral for N points, and the
    weights n n^T take two of them away. Farther than the nodes reach nothing is asked.

    Args:
        sharpness: ratio R / s of the radius to the least standard deviation.
    """
    k = sharpness * (sharpness + WIDE)
    points = 2 * np.ceil(0.5 * (3 + np.sqrt(2 * math.log(2 / RING_ERROR) * k)))
    return np.clip(points, 8, MOST_POINTS).astype(np.int32)


def rasterised(parts: Parts) -> tuple[device.Array, device.Array, device.Array]:
    """(rows, places, pool) of the windows that matter."""
    wanted = np.flatnonzero(parts.wanted)
    deviation = parts.deviation[wanted]
    radius = parts.radius[wanted, None]
    counts = np.ceil((radius / deviation + WIDE) / FINE).astype(np.int64) + 1
    nodes = counts.prod(axis=1)
    total = int(nodes.sum())
    if total > MOST_NODES:
        raise ValueError(
            f"chances_of: {len(wanted)} windows take {total} nodes, the pool holds {MOST_NODES}"
            f" ({MOST_NODES * CHANNELS * 4 / 2**20:.0f} MiB); forecast fewer objects or layers"
        )
    spacing = (radius + WIDE * deviation) / (counts - 1)
    # bilinear values fall short of the true ones by no more than this, see docs/risk.md
    margin = (1 + RING_ERROR) * (1 + ROUNDING) / np.cos(0.5 * spacing / deviation).prod(axis=1)
    places = np.full((len(parts.wanted), 4), -1, dtype=np.int32)
    places[wanted, 0] = np.cumsum(nodes) - nodes
    places[wanted, 1:3] = counts
    places[wanted, 3] = points_of(parts.radius[wanted] / deviation.min(axis=1))
    rows = parts.rows
    rows[wanted, 4:6] = 1 / spacing
    shapes = np.zeros((len(parts.wanted), 6), dtype=np.float32)
    shapes[wanted] = np.column_stack([deviation, radius, spacing, margin])
    pool = device.empty((max(total, 1) * CHANNELS,), np.float32)
    there = device.put(places)
    if total:
        scratch = scratch_memory(device.resident())
        rasterise_windows(device.share(), WORKERS, there, device.put(shapes), scratch, pool)
    return device.put(rows), there, pool


@functools.cache
def scratch_memory(resident: bool) -> device.Array:
    """What the workers of `rasterise_windows` write on; as `device.resident` tells."""
    return device.empty((WORKERS * SCRATCH,), np.float32)
