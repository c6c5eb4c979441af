"""The conservative model of the future, W: where anything could be, and when at the earliest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from passpmp_ti import backend, device, door
from passpmp_ti.grid.body import Body, bodies, to_poses
from passpmp_ti.grid.chances import Chances, chances_of
from passpmp_ti.grid.memory import Memory, check_previous
from passpmp_ti.grid.proven import Ground, proven
from passpmp_ti.grid.spans import spans_of
from passpmp_ti.grid.static_map import StaticMap
from passpmp_ti.grid.tubes import Laid, capped, layer_times, tubes_of
from passpmp_ti.grid.view import Labels, Views, labels_of
from passpmp_ti.grid.window import Window, size_for
from passpmp_ti.kernels.arrival import NEVER
from passpmp_ti.kernels.beams import LOST, MOVABLE
from passpmp_ti.kernels.check import check_path, check_states
from passpmp_ti.kernels.printed import printed_path_risk, printed_states_risk
from passpmp_ti.kernels.risk import path_risk, states_risk
from passpmp_ti.kernels.visibility import (
    BLIND_SOURCES,
    MOVABLE_CELLS,
    SOURCES,
    STANDING_SOURCES,
    STATIC_CELLS,
)
from passpmp_ti.robots import Robot
from passpmp_ti.scan import Scan
from passpmp_ti.settings import Settings

if TYPE_CHECKING:
    from passpmp_ti.tracking.tracks import Tracks

TICK = 1e-3
"""[s]"""
OFF_SPEED = 0.05
"""Share of its top speed by which a robot may be faster than it should be."""


@dataclass(frozen=True, slots=True, eq=False)
class FutureModel:
    """Everywhere something could possibly be, at every future time (Sec. 4.5, Fig. 4).

    The whole model is one number a cell: `ticks`, the time at which a robot disc centred anywhere
    in the cell could first be touched. It answers for any time from `stamp` on.
    """

    robot: Robot
    settings: Settings
    window: Window
    stamp: float
    """t_k, when the scans were taken [s]."""
    base_ticks: int
    """Whole milliseconds at or before `stamp`; `ticks` count from here."""
    ticks: device.Array
    """[J, I] uint16 [ms]; 0: never free; 65535: never reached."""
    seen_cells: device.Array
    """[J, I] uint8, 1: proven empty at `stamp`."""
    marks: device.Array
    """[5, J, I] uint8, 0 marks: sources, blind sources, sources behind standing things, static
    and movable surfaces."""
    views: Views
    broken_premises: np.ndarray
    """[n, 2] returns in space that the model before had proven free [m]."""
    hidden_ticks: device.Array = None
    """[J, I] uint16 [ms], as `ticks`: when something hidden or not tracked could come, at the bound
    of speed. What the next model remembers. `ticks` themselves in conservative mode."""
    strict_ticks: device.Array = None
    """[J, I] uint16 [ms], as `ticks`: the same for any mover, tracked or not. None in probabilistic
    mode, which asks nothing of it."""
    tracks: Tracks | None = None
    """The movers that are tracked; None in conservative mode."""
    chances: Chances | None = None
    """How likely they, and hidden ones, touch the robot; None but in probabilistic mode."""
    unexplained: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    """[n, 2] returns that may move and belong to no track [m]; their cones are in `ticks`."""
    body: Body = field(init=False, repr=False)
    """The robot in arrays, for NumPy."""
    there: Body = field(init=False, repr=False)
    """The same where the kernels run."""
    counts: device.Array = field(init=False, repr=False)
    """[15] int32 that the check's kernels read of the window and the robot."""
    _copies: dict[str, np.ndarray] = field(default_factory=dict, init=False, repr=False)
    """What has been brought to the host already."""
    spans: device.Array = field(init=False, repr=False)
    """[F] uint32: least and greatest ticks over blocks of cells, see kernels/spans.py."""
    hidden_spans: device.Array = field(init=False, repr=False)
    """[F] uint32: `spans` of `hidden_ticks`, where there are chances; else `spans`."""

    def __post_init__(self) -> None:
        if self.hidden_ticks is None:
            object.__setattr__(self, "hidden_ticks", self.ticks)
            object.__setattr__(self, "strict_ticks", self.ticks)
        body, there = bodies(self.robot, self.settings, device.resident())
        object.__setattr__(self, "body", body)
        object.__setattr__(self, "there", there)
        counts = device.put(body.placed(self.window.corner, self.window.size))
        object.__setattr__(self, "counts", counts)
        object.__setattr__(self, "spans", spans_of(self.ticks, counts, self.window.size))
        hidden_spans = self.spans
        if self.chances is not None:
            hidden_spans = spans_of(self.hidden_ticks, counts, self.window.size)
        object.__setattr__(self, "hidden_spans", hidden_spans)

    @classmethod
    def from_scan(
        cls,
        scan: Scan | Sequence[Scan],
        robot: Robot,
        settings: Settings,
        previous: FutureModel | None = None,
        static_map: StaticMap | None = None,
        *,
        position: tuple[float, float, float] | None = None,
        speed: float | None = None,
    ) -> FutureModel:
        """Build the model of what the scans saw.

        Args:
            scan: one, or several of one instant (their views are united).
            robot: whose discs the model is grown by.
            settings: bounds, margins and resolution.
            previous: the model of the cycle before; what it proved is never lost.
            static_map: surfaces that stay.
            position: the robot's (x, y, theta) at the scan [m, m, rad]. None: the first sensor's,
                which is right only for a sensor in the robot's middle: the robot's body is where
                nobody else is.
            speed: the robot's at the scan [m/s], for probabilistic mode: chances are laid where it
                can get to. None: its top speed.

        Raises:
            ValueError: scans of different instants, or a previous model that is newer or was made
                for another robot, or on another grid.
        """
        backend.init()
        scans = [scan] if isinstance(scan, Scan) else list(scan)
        if not scans:
            raise ValueError("FutureModel.from_scan: no scan given; give one, or several")
        stamp = scans[0].stamp
        apart = [s.stamp for s in scans if abs(s.stamp - stamp) > 1e-6]
        if apart:
            raise ValueError(
                f"FutureModel.from_scan: scans of one instant have one stamp; got {stamp} and"
                f" {apart[0]}; make one model after the other instead, with previous="
            )
        if static_map is not None:
            check_door(settings, static_map.resolution)
        if previous is not None:
            check_previous(previous, robot, settings, stamp)
        if position is None:
            position = scans[0].pose
        window = _window_for(scans, settings, position, previous)
        reach_of = [
            window.inner_radius - math.hypot(s.pose[0] - position[0], s.pose[1] - position[1])
            for s in scans
        ]
        base = math.floor(stamp / TICK + 1e-6)
        ground = Ground(
            labels_of(scans, settings, window.anchor, reach_of, static_map),
            _empty_discs(robot, settings, position, window, previous is None),
            window, base, robot, settings, static_map,
        )  # fmt: skip
        if not settings.tracks:
            strict = proven(ground, None if previous is None else previous.strict_memory)
            return cls(
                robot, settings, window, stamp, base, strict.ticks, strict.seen, strict.marks,
                strict.views, strict.broken,
            )  # fmt: skip
        return cls._with_tracks(ground, stamp, previous, position, speed)

    @classmethod
    def _with_tracks(
        cls,
        ground: Ground,
        stamp: float,
        previous: FutureModel | None,
        position: tuple[float, float, float],
        speed: float | None,
    ) -> FutureModel:
        """Hidden movers as ever, tracked ones by their tubes or as chances."""
        robot, settings, window = ground.robot, ground.settings, ground.window
        base = ground.base_ticks
        tracks = _followed(ground.labels, previous, settings, stamp)
        # Memory has no cones for movers that were tracked: one that is lost may be anywhere. So may
        # be whom a track was about that is met again, perhaps in somebody else.
        lost = tracks.ended or (previous is not None and _met_again(previous.tracks, tracks))
        memory = None if previous is None or lost else previous.memory
        hidden = proven(ground, memory, tracks.owner)
        forecast = tracks.forecast(layer_times(settings, robot, stamp))
        laid = Laid(window, base * TICK, stamp, robot, settings)
        if settings.mode == "hybrid":
            # what is proven of anybody whatever is proven of those who keep to their tubes
            strict = proven(ground, None if previous is None else previous.strict_memory)
            tubes = tubes_of(tracks, forecast, robot, settings, window, base * TICK)
            return cls(
                robot, settings, window, stamp, base,
                laid.tubes_over(hidden.ticks, tubes, strict.ticks), hidden.seen, hidden.marks,
                hidden.views, strict.broken, hidden.ticks, strict.ticks, tracks,
            )  # fmt: skip
        unexplained = np.concatenate(
            [
                hidden.views.points(v, window.anchor)[(met == MOVABLE) & (owner < 0)]
                for v, (met, owner) in enumerate(
                    zip(ground.labels.met, tracks.owner, strict=True)
                )
            ]
        )
        # the robot may be off the plan that the tree begins with
        off = settings.tracking_error + 2 * settings.localisation_error + settings.cell
        chances = chances_of(
            forecast.reduced(), robot, settings, position[:2], stamp, base, window.anchor,
            speed=None if speed is None else speed + OFF_SPEED * robot.top_speed, within=off,
            emergence=settings.emergence, hidden_speeds=settings.hidden_speeds,
        )  # fmt: skip
        return cls(
            robot, settings, window, stamp, base, laid.slowed(hidden.ticks, unexplained),
            hidden.seen, hidden.marks, hidden.views, hidden.broken, hidden.ticks, None, tracks,
            chances, unexplained,
        )  # fmt: skip

    @property
    def memory(self) -> Memory:
        """What is proven of hidden and untracked movers, for the next model."""
        return Memory(self.hidden_ticks, self.window, self.base_ticks)

    @property
    def strict_memory(self) -> Memory | None:
        """What is proven of any mover whatever; None in probabilistic mode."""
        if self.strict_ticks is None:
            return None
        return Memory(self.strict_ticks, self.window, self.base_ticks)

    @property
    def origin(self) -> tuple[float, float]:
        """World position of the outer corner of cell [0, 0] [m]."""
        return self.window.origin

    @property
    def cell(self) -> float:
        """Side of a cell [m]."""
        return self.window.cell

    @property
    def shape(self) -> tuple[int, int]:
        """(J, I)."""
        return (self.window.size, self.window.size)

    @property
    def base(self) -> float:
        """Time from which `ticks` count [s]."""
        return self.base_ticks * TICK

    @property
    def seen(self) -> np.ndarray:
        """[J, I] bool: proven empty at `stamp`."""
        return self._on_host("seen_cells").view(bool)

    @property
    def sources(self) -> np.ndarray:
        """[J, I] bool: cells that something may come out of."""
        marks = self._on_host("marks")
        return (marks[SOURCES] == 0) | (marks[BLIND_SOURCES] == 0)

    @property
    def standing_sources(self) -> np.ndarray:
        """[J, I] bool: sources from behind things that stand."""
        return self._on_host("marks")[STANDING_SOURCES] == 0

    @property
    def static(self) -> np.ndarray:
        """[J, I] bool: cells that hold a return from a surface that stays."""
        return self._on_host("marks")[STATIC_CELLS] == 0

    @property
    def movable(self) -> np.ndarray:
        """[J, I] bool: cells that hold a return from a surface that may move."""
        return self._on_host("marks")[MOVABLE_CELLS] == 0

    def ticks_of(self, times: np.ndarray | float) -> np.ndarray:
        """Absolute times [s] as ticks of this model, rounded up: a later time is less safe."""
        scaled = np.asarray(times, dtype=np.float64) / TICK - self.base_ticks
        return np.minimum(np.ceil(scaled - 1e-4), 2**30).astype(np.int32)

    def occupied(self, points: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Could anything touch a robot disc centred at a point, at a time?

        Args:
            points: [n, 2] [m].
            times: [n] absolute [s], none before `stamp`.

        Returns:
            [n] bool; False is a proof.

        Raises:
            ValueError: wrong shapes, or a time of which the model says nothing.
        """
        points = door.array("FutureModel.occupied", "points", points, (None, 2))
        ticks = self._checked_ticks("FutureModel.occupied", times, len(points))
        local = (points - np.array(self.window.anchor)).astype(np.float32)
        cells = np.floor(local * np.float32(1 / self.cell)).astype(np.int64)
        i = cells[:, 0] - self.window.corner[0]
        j = cells[:, 1] - self.window.corner[1]
        inside = (i >= 0) & (j >= 0) & (i < self.window.size) & (j < self.window.size)
        arrival = np.zeros(len(points), dtype=np.int64)
        arrival[inside] = self._on_host("ticks")[j[inside], i[inside]]
        return (arrival <= ticks) & (arrival != NEVER)

    def room(self, states: np.ndarray) -> np.ndarray:
        """About how long nothing could touch a robot that rests in states [n, 5], from the scan on
        [s]; between the values of cells, so it proves nothing: it says where there is more."""
        along = np.array([offset for offset, _ in self.robot.discs])[:, None]
        x = states[:, 0] + along * np.cos(states[:, 2]) - self.origin[0]
        y = states[:, 1] + along * np.sin(states[:, 2]) - self.origin[1]
        ticks = self._on_host("ticks")
        most = self.window.size - 2
        u, v = (np.clip(part / self.cell - 0.5, 0.0, most) for part in (x, y))
        i, j = u.astype(np.int64), v.astype(np.int64)
        u, v = u - i, v - j
        low = ticks[j, i] * (1 - u) + ticks[j, i + 1] * u
        high = ticks[j + 1, i] * (1 - u) + ticks[j + 1, i + 1] * u
        until = self.base + TICK * (low * (1 - v) + high * v).min(axis=0)
        return np.asarray(until - self.stamp)

    def passively_safe(self, states: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Whether each state can be braked to rest before anything can touch the robot (eq. 6).

        Args:
            states: [n, 5] within the robot's limits.
            times: [n] absolute [s], none before `stamp`.

        Returns:
            [n] bool; True is a proof. A robot at rest is passively safe by definition.

        Raises:
            ValueError: wrong shapes, states beyond the robot's limits, times before `stamp`.
        """
        return self.proving_brakes(states, times) >= 0

    def proving_brakes(self, states: np.ndarray, times: np.ndarray) -> np.ndarray:
        """[n] index of the braking control that proves each state p-safe; -1: ICS^b (eq. 7)."""
        owner = "FutureModel.passively_safe"
        states = self.robot.check_states(owner, states)
        ticks = self._checked_ticks(owner, times, len(states))
        return self._proved_on(self.ticks, self.spans, states, ticks)

    def _proved_on(
        self, arrival: device.Array, spans: device.Array, states: np.ndarray, ticks: np.ndarray
    ) -> np.ndarray:
        """[n] index of the braking control that stays clear of an arrival map; -1: none."""
        proof = np.zeros(len(states), dtype=np.int32)
        if len(states):
            check_states(
                self.there.kind, arrival, spans, self.there.numbers, self.counts,
                self.there.braking, to_poses(states, self.window.anchor), ticks, proof,
            )  # fmt: skip
        return proof - 1

    def collision_probability(self, states: np.ndarray, times: np.ndarray) -> np.ndarray:
        """P_ICS: the chance that something touches the robot although it brakes at once.

        The least over the braking set (eq. 11) of the chance that anything does at any time until
        rest (eq. 12; `Settings.risk` "paper": as printed). Bounded from above, see docs/risk.md.

        Args:
            states: [n, 5] within the robot's limits.
            times: [n] absolute [s], none before `stamp`.

        Returns:
            [n] float in [0, 1].

        Raises:
            ValueError: a model of another mode, wrong shapes, states beyond the robot's limits,
                times before `stamp`.
        """
        owner = "FutureModel.collision_probability"
        if self.chances is None:
            raise ValueError(
                f"{owner} needs chances, and this model was made with Settings.mode ="
                f' "{self.settings.mode}"; make it with mode="probabilistic"'
            )
        states = self.robot.check_states(owner, states)
        ticks = self._checked_ticks(owner, times, len(states))
        chance = np.zeros(len(states), dtype=np.float32)
        if not len(states):
            return chance.astype(np.float64)
        chances = self.chances.over(self.window)  # the robot need not get there in time
        poses, control = to_poses(states, self.window.anchor), np.zeros(len(states), np.int32)
        robot = self.there.numbers, self.counts, self.there.braking
        if self.settings.risk == "paper":
            printed_states_risk(
                self.there.kind, self.hidden_ticks, *robot, *chances.windows, poses, ticks,
                chance, control,
            )  # fmt: skip
        else:
            states_risk(
                self.there.kind, self.hidden_ticks, self.hidden_spans, *robot, *chances.hazard,
                poses, ticks, chance, control,
            )  # fmt: skip
        if len(self.unexplained):
            cones = self._cones()
            spans = spans_of(cones, self.counts, self.window.size)
            chance[self._proved_on(cones, spans, states, ticks) < 0] = 1.0
        return np.minimum(chance, 1.0).astype(np.float64)

    def motion_risk(self, states: np.ndarray, times: np.ndarray) -> float:
        """Chance that something touches the robot while it moves along a path, bounded from above.

        1 where it leads into what is seen and not tracked: that is there for sure.

        Args:
            states: [n, 5], at most a sample of the risk apart.
            times: [n] absolute [s], increasing.
        """
        assert self.chances is not None
        poses, ticks = to_poses(states, self.window.anchor), self.ticks_of(times)
        robot = self.there.numbers, self.counts
        if len(self.unexplained):
            met = np.zeros(len(states), dtype=np.int32)
            check_path(self.there.kind, self._cones(), *robot, poses, ticks, met)
            if met.any():
                return 1.0
        if self.settings.risk == "paper":
            each = np.zeros(len(states), dtype=np.float32)
            printed_path_risk(
                self.hidden_ticks, *robot, *self.chances.windows, poses, ticks, each
            )
            return float(min(each.prod(), 1.0))
        share, chance = np.zeros((len(states), 2), np.float32), np.zeros(3, np.float32)
        path_risk(
            self.there.kind, self.hidden_ticks, *robot, *self.chances.hazard, poses, ticks, share,
            chance,
        )  # fmt: skip
        return float(min(chance[2], 1.0))

    def touched(self, states: np.ndarray, times: np.ndarray) -> np.ndarray:
        """Along a path, asked at the look-ups of the check: could anything touch the robot?

        Args:
            states: [n, 5] at most a time step apart; what is farther apart is not judged clear.
            times: [n] absolute [s], increasing.

        Returns:
            [n] bool: whether anything could on the way from each state to the next, on which the
            robot moves. The last is False.
        """
        touched = np.zeros(len(states), dtype=np.int32)
        poses = to_poses(states, self.window.anchor)
        check_path(
            self.there.kind, self.ticks, self.there.numbers, self.counts, poses,
            self.ticks_of(times), touched,
        )  # fmt: skip
        return touched == 1

    def layer(self, index: int) -> np.ndarray:
        """[J, I] bool: cells that could be occupied at any moment of layer `index`.

        Layer l covers [base + l length, base + (l + 1) length), length = settings.layer_length. In
        probabilistic mode float32: the chance that anything touches a robot disc that stays
        anywhere in the cell for all of the layer (eq. 15, any object, any moment).
        """
        index = door.whole("FutureModel", "layer", index, least=0)
        if self.chances is not None:
            begin = self.base + index * self.settings.layer_length
            return self.chances.layer(
                self.window, self.hidden_ticks, max(begin, self.stamp),
                begin + self.settings.layer_length,
            )  # fmt: skip
        end = math.ceil((index + 1) * self.settings.layer_length / TICK - 1e-6)
        ticks = self._on_host("ticks")
        return (ticks < end) & (ticks != NEVER)

    def layers(self, count: int | None = None) -> np.ndarray:
        """[L, J, I] bool, the time-layered occupancy grid; chances in probabilistic mode.

        Args:
            count: how many layers; None: until twice the cycle and the longest braking after the
                base, the interval of Property 3.
        """
        if count is None:
            horizon = 2 * self.settings.cycle + self.robot.longest_braking
            count = math.ceil(horizon / self.settings.layer_length)
        return np.stack([self.layer(index) for index in range(count)])

    def _cones(self) -> device.Array:
        """[J, I] uint16: when what is seen and not tracked could be where, at the bound."""
        if "cones" not in self._copies:
            never = device.full((self.window.size, self.window.size), NEVER, np.uint16)
            self._copies["cones"] = capped(
                never, self.unexplained, self.window, self.robot, self.settings
            )
        return self._copies["cones"]

    def _on_host(self, name: str) -> np.ndarray:
        """One of the arrays, where NumPy reads it; brought there once."""
        if name not in self._copies:
            self._copies[name] = device.host(getattr(self, name))
        return self._copies[name]

    def _checked_ticks(self, owner: str, times: object, count: int) -> np.ndarray:
        times = door.array(owner, "times", times, (None,))
        if len(times) != count:
            raise ValueError(f"{owner}.times has {len(times)} elements for {count} points")
        early = np.flatnonzero(times < self.stamp - 1e-9)
        if len(early):
            raise ValueError(
                f"{owner}.times[{early[0]}] = {times[early[0]]:.6f} s is before the scan,"
                f" {self.stamp:.6f} s: the model speaks only of what comes after it"
            )
        return self.ticks_of(times)


def check_door(settings: Settings, resolution: float) -> None:
    """Refuse a map on which a door as wide as an object would be taken for wall.

    Its jambs are grown by the tolerance and reach up to a cell into it; what is left must be as
    wide as the cell that is sure to be asked.
    """
    left = settings.object_width - 2 * settings.map_tolerance - 2 * resolution
    if left < resolution:
        raise ValueError(
            f"Settings.map_tolerance = {settings.map_tolerance:g} m is too much for a static map of"
            f" {resolution:g} m cells and objects of {settings.object_width:g} m: a door as wide as"
            " an object must not be taken for wall; it may be"
            f" {0.5 * (settings.object_width - 3 * resolution):g} m at most, or the map finer"
        )


def _window_for(
    scans: Sequence[Scan],
    settings: Settings,
    position: tuple[float, float, float],
    previous: FutureModel | None,
) -> Window:
    if settings.window is not None:
        size = settings.window
    elif previous is not None:
        size = previous.window.size
    else:
        mounted = [math.hypot(s.pose[0] - position[0], s.pose[1] - position[1]) for s in scans]
        furthest = max(s.range_max + m for s, m in zip(scans, mounted, strict=True))
        size = size_for(furthest, settings.cell)
    anchor = previous.window.anchor if previous is not None else None
    return Window.around(position[0], position[1], size, settings.cell, anchor)


def _met_again(before: Tracks | None, now: Tracks) -> bool:
    """Whether a track is met that was not met in the cycle before."""
    if before is None:
        return False
    missed = before.ids[~before.seen]
    return bool(np.isin(now.ids[now.seen], missed).any())


def _followed(
    labels: Labels,
    previous: FutureModel | None,
    settings: Settings,
    stamp: float,
) -> Tracks:
    """The tracks of the model before, carried on by what the scans saw."""
    try:
        # filterpy and SciPy take longer to load than the rest of the planner
        from passpmp_ti.tracking.pursuit import follow
        from passpmp_ti.tracking.sighting import Sighting
    except ImportError as missing:
        raise ValueError(
            f'Settings.mode = "{settings.mode}" needs tracks, and {missing.name} is not installed:'
            f' pip install {missing.name}, or take mode="conservative"'
        ) from missing
    seen = []
    for v, scan in enumerate(labels.scans):
        bearing = scan.pose[2] + scan.angle_min
        seen.append(
            Sighting(
                origin=scan.pose[:2],
                bearings=bearing + scan.angle_increment * np.arange(len(scan.ranges)),
                ranges=labels.ranges[v].astype(np.float64),
                movable=labels.met[v] == MOVABLE,
                lost=labels.met[v] == LOST,
                increment=scan.angle_increment,
                closed=labels.closed[v],
                range_max=float(labels.view[v, 5]),
            )
        )
    return follow(None if previous is None else previous.tracks, seen, stamp, settings)


def _empty_discs(
    robot: Robot,
    settings: Settings,
    position: tuple[float, float, float],
    window: Window,
    first: bool,
) -> list[tuple[float, float, float]]:
    """Where nobody else can be: inside the robot's own body, and what is declared clear."""
    x, y, theta = position
    discs = [
        (x + offset * math.cos(theta), y + offset * math.sin(theta), radius)
        for offset, radius in robot.discs
    ]
    if first and settings.clear_radius > 0:
        # its border must lie in the window: what comes in over it is marked there
        discs.append((x, y, min(settings.clear_radius, window.inner_radius)))
    return discs
