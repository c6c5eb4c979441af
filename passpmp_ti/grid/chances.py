"""Probability layers: a forecast of tracked objects, rasterised about a robot's disc (eq. 15)."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from passpmp_ti import device, door
from passpmp_ti.grid.moments import Forecast, Moments, moments_of
from passpmp_ti.grid.reach import Reach
from passpmp_ti.grid.reused import Reused
from passpmp_ti.grid.window import Window
from passpmp_ti.kernels.chances import CHANNELS, MOST_POINTS, SCRATCH, rasterise_windows
from passpmp_ti.kernels.forecasts import LEFT_OUT
from passpmp_ti.kernels.hazard import KINDS, lay_hazard
from passpmp_ti.kernels.touched import layer_chances
from passpmp_ti.robots import Robot
from passpmp_ti.settings import Settings, integration_margin

TICK = 1e-3
"""[s]"""
SAMPLE = 0.1
"""Length of a sample of a motion, if the time step is no longer [s]."""
FINE = 0.5
"""Between two nodes of a window [standard deviations]."""
WIDE = 4.5
"""How far beyond the disc a window's nodes reach [standard deviations]."""
MOST_NODES = 4_000_000
"""Nodes of all windows of one forecast: 96 MB."""
WORKERS = 256
STRIP, STRIP_ON_DEVICE = 16, 2
"""Nodes that a thread lays in one go: what is common to them is worked out once, and a device has
more threads than a CPU."""
RING_ERROR = 1e-3
"""Bound on the relative error of the integrals over a ring, see `points_of`."""
ROUNDING = 1e-4
"""Relative, of the sums in single precision."""


_memory = Reused()


@dataclass(frozen=True, slots=True, eq=False)
class Chances:
    """How likely tracked and hidden objects touch one robot; what kernels/risk.py reads.

    For how the arrays are laid out see kernels/chances.py.
    """

    forecast: Forecast
    robot: Robot
    settings: Settings
    stamp: float
    """Of the scan [s]."""
    base_ticks: int
    """From which ticks count [ms]."""
    anchor: tuple[float, float]
    """From which places count [m]."""
    emergence: float
    hidden_speeds: tuple[float, ...]
    rows: device.Array
    places: device.Array
    near: device.Array
    pool: device.Array
    layers: device.Array
    grids: device.Array
    begins: device.Array
    starts: device.Array
    odds: device.Array
    tally: device.Array
    _over: dict[tuple[Window, float], Chances] = field(default_factory=dict, repr=False)

    @property
    def hazard(self) -> tuple[device.Array, ...]:
        """What the functions and kernels of kernels/risk.py take, in their order."""
        return self.layers, self.grids, self.begins, self.starts, self.odds, self.tally

    @property
    def windows(self) -> tuple[device.Array, ...]:
        """What those of kernels/printed.py take."""
        return self.rows, self.places, self.near, self.pool, self.starts, self.odds, self.tally

    @property
    def memory(self) -> int:
        """Bytes of windows and layers."""
        return 4 * (self.pool.shape[0] + self.layers.shape[0])

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
        door.finite("Chances.layer", "begin", begin, least=self.stamp - TICK, unit="s")
        door.finite("Chances.layer", "end", end, above=begin, unit="s")
        # for discs centred anywhere in a cell
        grown = self.over(window, math.sqrt(0.5) * window.cell)
        chances = np.zeros((window.size, window.size), dtype=np.float32)
        layer_chances(
            ticks, *grown.windows, *window.corner, float(window.cell),
            begin / TICK - self.base_ticks, end / TICK - self.base_ticks,
            math.ceil((end - begin) / sample_steps(self.settings) / self.settings.time_step),
            chances,
        )  # fmt: skip
        return chances

    def over(self, window: Window, extra: float = 0.0) -> Chances:
        """The same for discs anywhere in a window, where the robot can get to or not; made once.

        Args:
            window: anchored as this is.
            extra: added to the discs' radii [m].
        """
        key = window, extra
        if key not in self._over:
            middle = 0.5 * window.size * window.cell
            self._over[key] = chances_of(
                self.forecast, self.robot, self.settings,
                (window.origin[0] + middle, window.origin[1] + middle), self.stamp,
                self.base_ticks, self.anchor, emergence=self.emergence,
                hidden_speeds=self.hidden_speeds, extra=extra, within=math.sqrt(2) * middle,
            )  # fmt: skip
        return self._over[key]


def chances_of(
    forecast: Forecast,
    robot: Robot,
    settings: Settings,
    position: tuple[float, float],
    stamp: float,
    base_ticks: int,
    anchor: tuple[float, float],
    *,
    speed: float | None = None,
    emergence: float = 1.0,
    hidden_speeds: Sequence[float] = (1.0,),
    extra: float = 0.0,
    within: float = 0.0,
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
        speed: of the robot at `stamp` [m/s], which plans as `settings` tell: the layers are the
            finer the less far it can get. None: it may drive at its top speed for good.
        emergence: chance that something comes out of what is hidden.
        hidden_speeds: equally likely speeds of it, as shares of `Settings.object_speed`.
        extra: added to the discs' radii [m].
        within: from `position` all is rasterised that is no farther [m].

    Raises:
        ValueError: chances outside [0, 1], times that are not equally spaced, or more windows than
            memory is allowed for.
    """
    emergence = door.finite("chances_of", "emergence", emergence, least=0.0, most=1.0)
    speeds = door.array("chances_of", "hidden_speeds", hidden_speeds, (None,))
    if not len(speeds) or speeds.min() < 0 or speeds.max() > 1:
        raise ValueError(
            f"chances_of.hidden_speeds = {tuple(hidden_speeds)}: one share of the bound at least,"
            " each between 0 and 1"
        )
    spacing = np.diff(forecast.times)
    if not len(spacing) or spacing.min() <= 0 or np.ptp(spacing) > 1e-6:
        raise ValueError(
            f"chances_of.forecast.times must be two at least, increasing and equally spaced; got"
            f" {forecast.times}"
        )
    span = sample_steps(settings) * settings.time_step
    radius = body_radius(robot, settings, span) + extra + forecast.radius
    plans_end = math.inf if speed is None else stamp + settings.horizon
    reach = Reach.of(robot, position, stamp, speed, within, plans_end)
    moments = moments_of(forecast, radius, reach, anchor)
    objects, components = forecast.weight.shape
    clock = 16 + len(speeds)
    odds = np.zeros(clock + len(moments.times), dtype=np.float32)
    odds[:7] = (
        forecast.times[0] / TICK - base_ticks, TICK / spacing[0], LEFT_OUT * objects, clock,
        moments.left_out, emergence, math.ceil(stamp / TICK - base_ticks - 1e-6),
    )  # fmt: skip
    odds[16:clock] = speeds
    odds[clock:] = moments.times / TICK - base_ticks
    tally = np.array(
        [objects, components, len(moments.times), len(speeds), sample_steps(settings)],
        dtype=np.int32,
    )
    there = device.put(tally)
    rows, places, pool = rasterised(moments)
    near, grids = _put(moments.near), _put(moments.grids)
    layers, begins = laid(moments, rows, places, near, pool, there, grids)
    return Chances(
        forecast, robot, settings, stamp, base_ticks, anchor, emergence,
        tuple(float(s) for s in speeds), rows, places, near, pool, layers, grids, begins,
        device.put(moments.starts), device.put(odds), there,
    )  # fmt: skip


def _put(values: np.ndarray) -> device.Array:
    """`values` where the kernels read them; a row of zeros, which nobody asks for, instead of none:
    a device has no empty arrays."""
    return device.put(values if len(values) else np.zeros((1, *values.shape[1:]), values.dtype))


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
        + settings.object_speed * settings.stamp_error
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


def rasterised(moments: Moments) -> tuple[device.Array, device.Array, device.Array]:
    """(rows, places, pool) of the windows that matter."""
    wanted = np.flatnonzero(moments.wanted)
    deviation = moments.deviation[wanted]
    radius = moments.radius[wanted, None]
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
    places = np.full((len(moments.wanted), 4), -1, dtype=np.int32)
    places[wanted, 0] = np.cumsum(nodes) - nodes
    places[wanted, 1:3] = counts
    places[wanted, 3] = points_of(moments.radius[wanted] / deviation.min(axis=1))
    rows = moments.rows
    rows[wanted, 4:6] = 1 / spacing
    shapes = np.zeros((len(moments.wanted), 6), dtype=np.float32)
    shapes[wanted] = np.column_stack([deviation, radius, spacing, margin])
    pool = _memory.floats(max(total, 1) * CHANNELS)
    there = _put(places)
    if total:
        rasterise_windows(device.share(), WORKERS, there, _put(shapes), _scratch(), pool)
    return _put(rows), there, pool


def laid(
    moments: Moments,
    rows: device.Array,
    places: device.Array,
    near: device.Array,
    pool: device.Array,
    tally: device.Array,
    grids: device.Array,
) -> tuple[device.Array, device.Array]:
    """(layers, begins): the windows of all objects summed up about where the robot can be."""
    nodes = moments.sides.prod(axis=0)
    begins = np.stack([np.cumsum(nodes) - nodes, *moments.sides], -1).astype(np.int32)
    layers = _memory.floats(int(nodes.sum()) * KINDS)
    there = device.put(begins)
    strip = STRIP_ON_DEVICE if device.resident() else STRIP
    lay_hazard(
        rows, places, near, pool, tally, grids, there, int(moments.sides.max()), strip, layers
    )
    return layers, there


class _Scratch(threading.local):
    """What each thread's `rasterise_windows` writes on."""

    def __init__(self) -> None:
        self._arrays: dict[bool, device.Array] = {}

    def __call__(self) -> device.Array:
        key = device.resident()
        if key not in self._arrays:
            self._arrays = {key: device.empty((WORKERS * SCRATCH,), np.float32)}
        return self._arrays[key]


_scratch = _Scratch()
