"""Every number that a user may set, in one place, refused at birth where it makes no sense."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

from passpmp_ti import door
from passpmp_ti.robots import CarLike, Robot

MODES = ("conservative", "hybrid", "probabilistic")
RISKS = ("any", "paper")
CONES = ("straight", "geodesic")
OPTIMIZERS = ("pso", "exhaustive")
GUIDES = ("safe_time", "euclidean")
DISTANCES = ("mean", "final")
LOOK = 0.25
"""How far a disc's centre may be from the nearest look at its path [cells]."""


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is assumed of the world, how fine the model is, and how plans are made and judged."""

    # what is assumed of the world
    mode: str = "conservative"
    """Safety mode. "conservative": nothing is assumed but bounds, and the guarantee is strict.
    "hybrid": a mover that is tracked stays where its track says, at `confidence`. "probabilistic":
    risk is a number, bounded by `allowed_risk`."""
    object_speed: float = 2.0
    """v_b, greatest speed of any object [m/s]; 0 is allowed: nothing moves."""
    object_width: float = 0.4
    """Objects are no narrower than this [m], and their corners no sharper than a right angle."""
    object_radius: float = 0.0
    """Every point of a moving object lies in a disc of this radius inside the object [m]: nothing
    that moves hides where no such disc fits. 0: a point may hide in every sliver."""
    blind_speed: float | None = None
    """Greatest speed, from then on, of what was within range in a bearing that no sensor covers
    [m/s]; None: as `object_speed`; 0: what is there stands still for good, like a wall."""
    cones: str = "straight"
    """How what comes out of hiding is taken to come: "straight", as the crow flies; "geodesic":
    round surfaces that stay, not through them. Conservative mode; `blind_speed` 0 or v_b."""
    clear_radius: float = 0.0
    """Disc about the robot's start that is declared empty [m]; for robots with blind sectors."""

    # what is assumed of movers that are tracked, and of the hidden ones as a chance
    confidence: float = 0.99
    """Chance that a tracked mover stays, over all of the horizon, where "hybrid" takes it to be."""
    allowed_risk: float = 0.03
    """Greatest chance of a contact while moving that one plan may have."""
    allowed_risk_rate: float = 0.03
    """The same for each second of a plan that is longer than one [1/s]."""
    risk: str = "any"
    """"any": the chance of a contact at any time with any mover, bounded from above; "paper": eqs.
    9-17 as printed, products over times and over the states of a plan."""
    emergence: float = 0.02
    """Chance, each time the robot plans, that somebody comes out of what is hidden on the worst
    way."""
    hidden_speeds: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
    """Equally likely speeds of who comes out, as shares of `object_speed`."""

    # margins, each added to the unsafe side
    tracking_error: float = 0.0
    """Greatest distance between the robot and its plan [m]."""
    localisation_error: float = 0.0
    """Greatest error of a pose [m]; counted twice, once for the scan and once for the robot."""
    range_noise: float = 0.0
    """Greatest error of a range [m]."""
    stamp_error: float = 0.0
    """Greatest age of a scan that its stamp does not tell [s]."""
    map_tolerance: float = 0.1
    """Returns nearer than this to a surface of the static map are that surface [m]."""

    # how fine the model is
    cell: float = 0.1
    """Side of a grid cell [m]."""
    window: int | None = None
    """Cells along each side of the grid; None: what the sensors' range asks for."""
    time_step: float = 0.02
    """Time between the samples at which motions are checked [s]; a whole number of ms."""
    layer_length: float = 0.1
    """Length of a layer of `FutureModel.layers` [s], and the least time between the moments at
    which tracked movers are forecast; arrival times are kept to 1 ms whatever this is."""

    # the cycle and the tree
    cycle: float = 0.1
    """delta_cycle [s]; a whole number of time steps."""
    primitives: tuple[float, ...] = (0.4, 0.6, 1.0)
    """Durations of the primitives after the first [s]; the first lasts one cycle."""
    capacity: int = 1200
    """Most nodes a tree may have."""
    exploration_time: float | None = None
    """Time budget of the tree's growth [s], t_exploration of Algorithm 2; None: no budget."""

    deadline: float | None = None
    """Wall clock time within which a cycle must answer [s]: exploration ends in time for what comes
    after it, and a plan that is late all the same is dropped: the robot goes on with what it holds.
    `Navigator` then compiles every kernel beforehand, which takes seconds, keeps Python's garbage
    collector out of its cycles, and exempts from it what the process holds (`gc.freeze`). None:
    simulated time; nothing is decided by a clock."""

    # the choice
    optimizer: str = "pso"
    """"pso" (Algorithm 3) or "exhaustive" (the true optimum over the leaves)."""
    particles: int = 100
    """N_p."""
    iterations: int = 60
    """iteration_max of Algorithm 3."""
    sub_swarms: int = 2
    """Swarms that search apart and share their best at the end."""
    cognitive: float = 2.0
    """w_c of eq. 2."""
    social: float = 2.0
    """w_s of eq. 2."""
    velocity_max: float = 1.0
    """V_pmax of Algorithm 3; priorities lie in [0, 1]."""
    guide: str = "safe_time"
    """"safe_time": time to the goal at the speed that will be safe; "euclidean": the paper's."""
    guide_movers: bool = False
    """Whether the guide keeps away from movers where they are now, as from corners: worth it among
    people who stand about, not among fast movers that are elsewhere by then."""
    guide_margin: float = 1.0
    """How much of the grids' rounding the guide keeps from walls beside the clearance. 1: it leads
    where every cell lets the robot through; 0: where the clearance does, though some cells may
    not, and so into passages that are hardly wider than the robot and its margins."""
    distance: str = "mean"
    """"mean": the guide averaged along the plan; "final": at its last state (eq. 18)."""
    weight_distance: float = 1.0
    """w_d of eq. 5."""
    weight_time: float = 0.02
    """w_t of eq. 5. With distance="mean" all plans are judged over one time and it decides nothing;
    with "final" it weighs a plan's duration."""
    weight_turn: float = 0.5
    """Share of the time to turn towards the way down that the guide adds; 0: places alone."""
    goal_tolerance: float = 0.3
    """The goal is reached at rest within this distance [m]."""
    cruise_speed: float | None = None
    """The guide's idea of the robot's speed in the open [m/s]; None: the robot's top speed."""
    patience: float | None = 10.0
    """After so long about one place short of the goal the robot backs out and tries from elsewhere
    [s]; None: it stands for as long as nothing better is in reach. With guide="safe_time"."""

    def __post_init__(self) -> None:
        name = "Settings"
        door.choice(name, "mode", self.mode, MODES)
        door.choice(name, "optimizer", self.optimizer, OPTIMIZERS)
        door.choice(name, "guide", self.guide, GUIDES)
        door.choice(name, "distance", self.distance, DISTANCES)
        door.choice(name, "risk", self.risk, RISKS)
        door.choice(name, "cones", self.cones, CONES)
        self._check_chances()
        for field_ in (
            "object_speed",
            "object_radius",
            "clear_radius",
            "tracking_error",
            "localisation_error",
            "range_noise",
            "stamp_error",
            "map_tolerance",
            "cognitive",
            "social",
            "weight_distance",
            "weight_time",
            "weight_turn",
        ):
            door.finite(name, field_, getattr(self, field_), least=0.0)
        for field_ in (
            "object_width",
            "cell",
            "time_step",
            "layer_length",
            "cycle",
            "velocity_max",
            "goal_tolerance",
        ):
            door.finite(name, field_, getattr(self, field_), above=0.0)
        for field_ in ("blind_speed", "exploration_time", "deadline"):
            if getattr(self, field_) is not None:
                door.finite(name, field_, getattr(self, field_), least=0.0)
        if self.cruise_speed is not None:
            door.finite(name, "cruise_speed", self.cruise_speed, above=0.0, unit="m/s")
        if self.patience is not None:
            door.finite(name, "patience", self.patience, above=0.0, unit="s")
        if self.blind_speed is not None and self.blind_speed > self.object_speed:
            raise ValueError(
                f"Settings.blind_speed = {self.blind_speed:g} m/s is above object_speed ="
                f" {self.object_speed:g} m/s, which bounds every object; leave it out or lower it"
            )
        self._check_cones()
        door.finite(name, "guide_margin", self.guide_margin, least=0.0, most=1.0)
        if not isinstance(self.guide_movers, bool):
            raise ValueError(
                f"Settings.guide_movers must be true or false; got {self.guide_movers!r}"
            )
        if self.window is not None:
            door.whole(name, "window", self.window, least=16, most=8192)
            if self.window % 16:
                raise ValueError(
                    f"Settings.window must be a multiple of 16 cells; got {self.window}"
                )
        for field_, most in (
            ("capacity", 50_000_000),
            ("particles", 100_000),
            ("iterations", 100_000),
            ("sub_swarms", 10_000),
        ):
            door.whole(name, field_, getattr(self, field_), least=1, most=most)
        if self.particles % self.sub_swarms:
            raise ValueError(
                f"Settings.particles = {self.particles} does not divide into sub_swarms ="
                f" {self.sub_swarms} of one size"
            )
        step_ms = self.time_step * 1000
        if not _is_whole(step_ms):
            raise ValueError(
                f"Settings.time_step must be a whole number of milliseconds; got {step_ms:g} ms"
            )
        if isinstance(self.primitives, (str, bytes)) or not hasattr(self.primitives, "__iter__"):
            raise ValueError(f"Settings.primitives must be durations [s]; got {self.primitives!r}")
        object.__setattr__(self, "primitives", tuple(self.primitives))
        for field_, value in [("cycle", self.cycle)] + [
            (f"primitives[{i}]", p) for i, p in enumerate(self.primitives)
        ]:
            door.finite(name, field_, value, above=0.0, unit="s")
            count = value / self.time_step
            if not _is_whole(count):
                raise ValueError(
                    f"Settings.{field_} = {value:g} s must be a whole number of time steps of"
                    f" {self.time_step:g} s, so that plans are verified and held at the same times"
                )

    def _check_chances(self) -> None:
        name = "Settings"
        for field_ in ("confidence", "allowed_risk"):
            value = door.finite(name, field_, getattr(self, field_))
            if not 0.0 < value < 1.0:
                raise ValueError(
                    f"Settings.{field_} is a chance, above 0 and below 1; got {value:g}; for no"
                    ' risk at all take mode="conservative"'
                )
        door.finite(name, "allowed_risk_rate", self.allowed_risk_rate, above=0.0, unit="1/s")
        door.finite(name, "emergence", self.emergence, least=0.0, most=1.0)
        if isinstance(self.hidden_speeds, (str, bytes)) or not hasattr(
            self.hidden_speeds, "__iter__"
        ):
            raise ValueError(
                f"Settings.hidden_speeds must be shares of object_speed; got {self.hidden_speeds!r}"
            )
        object.__setattr__(self, "hidden_speeds", tuple(self.hidden_speeds))
        if not self.hidden_speeds:
            raise ValueError(
                "Settings.hidden_speeds is empty; give shares of object_speed, (1.0,) for the bound"
            )
        for n, share in enumerate(self.hidden_speeds):
            door.finite(name, f"hidden_speeds[{n}]", share, least=0.0, most=1.0)
        if self.tracks and self.object_speed == 0.0:
            raise ValueError(
                f'Settings.mode = "{self.mode}" needs tracks, and where object_speed is 0 nothing'
                ' moves that could be tracked; take mode="conservative"'
            )

    def _check_cones(self) -> None:
        if self.cones == "straight":
            return
        if self.tracks:
            raise ValueError(
                f'Settings.cones = "{self.cones}" with mode = "{self.mode}": a tracked mover hides'
                " what is behind it only until it moves on, so its surface must not bar a way; take"
                ' cones="straight", or mode="conservative"'
            )
        if 0.0 < self.unseen_speed < self.object_speed:
            raise ValueError(
                f'Settings.cones = "{self.cones}" with blind_speed = {self.blind_speed:g} m/s and'
                f" object_speed = {self.object_speed:g} m/s: ways are followed at one speed; leave"
                ' blind_speed out, set it to 0, or take cones="straight"'
            )

    @classmethod
    def for_robot(cls, robot: Robot, **changes: Any) -> Settings:
        """Settings that drive `robot` well, with `changes` on top.

        Raises:
            ValueError: an unknown name (the nearest is suggested), or a value out of its range.
        """
        if isinstance(robot, CarLike):
            own: dict[str, Any] = dict(
                object_speed=20.0,
                object_width=0.8,
                cell=0.25,
                cycle=0.1,
                primitives=(0.5, 1.0, 1.5),
                goal_tolerance=3.0,
                particles=100,
            )
        else:
            own = dict(
                object_speed=2.0,
                object_width=0.4,
                cell=0.04,
                time_step=0.01,
                cycle=0.1,
                primitives=(0.4, 0.6, 1.0),
                goal_tolerance=0.3,
                particles=50,
                cruise_speed=1.5,
                guide_movers=True,
            )
        return cls(**own).changed(**changes)

    def changed(self, **changes: Any) -> Settings:
        """These settings with some fields replaced; unknown names suggest the nearest."""
        known = [f.name for f in fields(self)]
        for given in changes:
            if given not in known:
                raise ValueError(
                    f"Settings has no field {given!r}{door.nearest(given, known)};"
                    f" it has {', '.join(known)}"
                )
        return replace(self, **changes)

    @property
    def tracks(self) -> bool:
        """Whether movers are tracked."""
        return self.mode != "conservative"

    @property
    def horizon(self) -> float:
        """How long after a scan the longest plan of its cycle is braked for [s], without braking
        itself (Property 3): what a model speaks of ends with it."""
        return 2 * self.cycle + sum(self.primitives)

    @property
    def unseen_speed(self) -> float:
        """Greatest speed of what comes out of never-covered bearings [m/s]."""
        return self.object_speed if self.blind_speed is None else self.blind_speed

    @property
    def step_ms(self) -> int:
        """The time step in ticks of one millisecond."""
        return round(self.time_step * 1000)

    def steps_of(self, duration: float) -> int:
        """A duration [s] in time steps."""
        return round(duration / self.time_step)

    @property
    def levels(self) -> tuple[int, ...]:
        """Steps of the primitives of each level of the tree, the cycle first."""
        return tuple(self.steps_of(d) for d in (self.cycle, *self.primitives))

    def clearance(self, robot: Robot) -> float:
        """Distance that a disc's centre keeps from whatever may be occupied [m].

        Sum of the disc's radius and of every margin in space that does not depend on the grid:
        tracking, localisation of scan and robot, the motion between samples, the integrator.
        """
        return (
            robot.disc_radius
            + self.tracking_error
            + 2 * self.localisation_error
            + motion_margin(robot, self)
            + integration_margin(robot, self.time_step)
        )


def motion_margin(robot: Robot, settings: Settings) -> float:
    """How far a disc's centre can be from the nearest look at its path [m].

    Looks lie on the straight way between samples, `LOOK` cells to either side of each; the true way
    leaves the straight one by at most a dt^2 / 8, a the greatest acceleration of a disc's centre.
    """
    return LOOK * settings.cell + robot.top_acceleration * settings.time_step**2 / 8


def integration_margin(robot: Robot, time_step: float) -> float:
    """Bound on the distance between an integrated braking path and the true one [m].

    The integrators are of order two; `Robot.integration_error` sums their steps over the longest
    braking. A millimetre more for f32. Measured in the tests.
    """
    return robot.integration_error(time_step) + 1e-3


def _is_whole(count: float) -> bool:
    """Whether it is a whole number, but for rounding, from 1 on."""
    return math.isfinite(count) and round(count) >= 1 and abs(count - round(count)) <= 1e-6
