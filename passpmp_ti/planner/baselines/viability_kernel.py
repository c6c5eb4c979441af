"""The viability kernel: all states of a lattice from which a robot can go on for ever."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from passpmp_ti import device
from passpmp_ti.kernels.viability import step_back
from passpmp_ti.planner.baselines.known import KnownWorld
from passpmp_ti.planner.baselines.lattice import HEADINGS, LEVELS, LOOKS, Lattice, Move
from passpmp_ti.settings import Settings
from passpmp_ti.trajectory import Trajectory

TURN = 2 * math.pi / HEADINGS
"""Between two headings [rad]."""
SLACK = 1e-3
"""[m] for rounding to single precision, which must never free a place."""
MOST_GAPS = 250_000_000
"""Most numbers that tell of a world's gaps; four bytes each."""
MOVE, SHORTEST, LONGEST = 1.0, 0.5, 2.0
"""[s] that a move is to last, and may."""


def half_move(settings: Settings, period: float | None) -> int:
    """Time steps of half a move: about half a second, a move being a whole number of cycles and, if
    there is a period, a period a whole number of moves.

    Raises:
        ValueError: there is no such number.
    """
    cycle = settings.steps_of(settings.cycle)
    steps = None if period is None else period / settings.time_step
    found = []
    for count in range(1, math.ceil(LONGEST / settings.cycle) + 1):
        move = count * cycle
        seconds = move * settings.time_step
        whole = steps is None or abs(steps / move - round(steps / move)) < 1e-6
        if move % 2 == 0 and whole and SHORTEST <= seconds <= LONGEST:
            found.append((abs(seconds - MOVE), move // 2))
    if not found:
        raise ValueError(
            f"KnownWorld.period = {period} s: moves last {SHORTEST:g} to {LONGEST:g} s, a whole"
            f" number of cycles of {settings.cycle:g} s, and must divide it; take a period of"
            " whole seconds and a cycle of 0.1 s"
        )
    return min(found)[1]


@dataclass(frozen=True, slots=True, eq=False)
class ViabilityKernel:
    """Which states are viable at the moments at which moves begin."""

    lattice: Lattice
    world: KnownWorld
    slices: tuple[np.ndarray, ...]
    """[HEADINGS, J, I] uint8 at each moment: bit l is set where level l is viable."""
    begin: float
    """Time of the first slice [s]."""
    back_to: int
    """The slice that follows the last one: the last itself where the world has frozen by then."""

    @classmethod
    def computed(cls, lattice: Lattice, world: KnownWorld, begin: float) -> ViabilityKernel:
        """Take out what leads to a touch, backwards in time, until nothing more is lost.

        Raises:
            ValueError: the world is too large, or is known for too long.
        """
        if world.period is not None:
            count, back_to = round(world.period / lattice.duration), 0
        else:
            assert world.freezes_at is not None
            count = max(math.ceil((world.freezes_at - begin) / lattice.duration), 0) + 1
            back_to = count - 1
        gaps = device.put(_gaps(lattice, world, begin, count))
        rows, columns = gaps.shape[1:]
        fixed = (
            len(LEVELS),
            device.put(np.array([(m.before, m.after) for m in lattice.moves], dtype=np.int32)),
            device.put(_ways(lattice)), device.put(_needed(lattice, world).astype(np.float32)),
            device.put(_boxes(lattice)),
        )  # fmt: skip
        every = (1 << len(LEVELS)) - 1
        shape = (HEADINGS, rows, columns)
        slices = [device.full(shape, every, np.uint8) for _ in range(count)]
        # a frozen world is settled by itself; what leads to it, by one way back
        settled = count
        lost = 1
        while lost and back_to == count - 1:
            last = device.put(device.host(slices[-1]).copy())
            lost = step_back(gaps, (count - 1) * LOOKS, *fixed, last, slices[-1])
            settled = count - 1
        lost = 1
        while lost:
            lost = 0
            for k in reversed(range(settled)):
                lost += step_back(gaps, k * LOOKS, *fixed, slices[(k + 1) % count], slices[k])
            if world.period is None:
                break
        kept = tuple(device.host(s) for s in slices)
        return cls(lattice, world, kept, begin, back_to)

    def keeps(self, move: Move, driven: Trajectory, start: float) -> bool:
        """Whether a move, as it is really driven, touches nothing and ends in the kernel.

        Args:
            move: one of the lattice's.
            driven: from `start` on.
            start: a moment at which moves begin [s].
        """
        lattice, world = self.lattice, self.world
        times = start + (np.arange(LOOKS) + 0.5) * lattice.duration / LOOKS
        places = driven.sampled(times)[:, :2]
        free = world.clearance(places)
        if len(world.movers.radius):
            apart = np.linalg.norm(world.movers.positions(times) - places[:, None], axis=2)
            free = np.minimum(free, (apart - world.movers.radius).min(axis=1))
        if (free < lattice.motion.robot.radius + _between_looks(lattice, world, move)).any():
            return False
        end = start + lattice.duration
        return self.viable(driven.at(end), move.after, end)

    def viable(self, state: np.ndarray, level: int, time: float) -> bool:
        """Whether a state at a moment at which moves begin [s] is in the kernel."""
        k = round((time - self.begin) / self.lattice.duration)
        if k >= len(self.slices):
            k = self.back_to + (k - self.back_to) % (len(self.slices) - self.back_to)
        low = np.array(self.world.bounds[:2])
        i, j = np.floor((state[:2] - low) / self.lattice.cell).astype(int)
        h = math.floor(state[2] / TURN + 0.5) % HEADINGS
        _, rows, columns = self.slices[k].shape
        if not (0 <= i < columns and 0 <= j < rows):
            return False
        return bool(self.slices[k][h, j, i] >> level & 1)


def _gaps(lattice: Lattice, world: KnownWorld, begin: float, count: int) -> np.ndarray:
    """[count * LOOKS, J, I] float32: from each cell's centre to the nearest thing, at each look."""
    x_low, y_low, x_high, y_high = world.bounds
    # no cell reaches beyond the bounds
    columns = math.floor((x_high - x_low) / lattice.cell)
    rows = math.floor((y_high - y_low) / lattice.cell)
    if count * LOOKS * rows * columns > MOST_GAPS:
        raise ValueError(
            f"KnownWorld: {count} moves in {rows} x {columns} cells are too many to work out;"
            " take narrower bounds, or a shorter period or time until it freezes"
        )
    x = x_low + (np.arange(columns) + 0.5) * lattice.cell
    y = y_low + (np.arange(rows) + 0.5) * lattice.cell
    centres = np.stack(np.meshgrid(x, y), axis=-1)
    fixed = world.clearance(centres.reshape(-1, 2)).reshape(rows, columns)
    gaps = np.empty((count * LOOKS, rows, columns), dtype=np.float32)
    times = begin + (np.arange(count * LOOKS) + 0.5) * lattice.duration / LOOKS
    for n, places in enumerate(world.movers.positions(times)):
        gap = fixed
        for place, radius in zip(places, world.movers.radius, strict=True):
            gap = np.minimum(gap, np.hypot(*np.moveaxis(centres - place, -1, 0)) - radius)
        gaps[n] = gap
    return gaps


def _between_looks(lattice: Lattice, world: KnownWorld, move: Move) -> float:
    """How much nearer something may come before or after a look along a move [m]."""
    fastest = max(abs(LEVELS[move.before]), abs(LEVELS[move.after])) * lattice.level
    return 0.5 * lattice.duration / LOOKS * (fastest + world.movers.top_speed) + SLACK


def _needed(lattice: Lattice, world: KnownWorld) -> np.ndarray:
    """[U * LOOKS] room about each look of each move [m].

    The robot may be anywhere in its cell, and a look is rounded to a cell: half a diagonal each.
    It may head half a step beside its heading.
    """
    room = lattice.motion.robot.radius + math.sqrt(2) * lattice.cell
    aside = 0.5 * TURN * np.linalg.norm(lattice.looks, axis=2)
    between = np.array([_between_looks(lattice, world, move) for move in lattice.moves])
    return (room + aside + between[:, None]).ravel()


def _turned(points: np.ndarray) -> np.ndarray:
    """[HEADINGS, ..., 2] points [..., 2] turned to each heading."""
    angles = TURN * np.arange(HEADINGS).reshape(-1, *[1] * (points.ndim - 1))
    c, s = np.cos(angles), np.sin(angles)
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _ways(lattice: Lattice) -> np.ndarray:
    """[H * U * LOOKS, 2] float32, see kernels/viability.py."""
    return (_turned(lattice.looks) / lattice.cell).reshape(-1, 2).astype(np.float32)


def _boxes(lattice: Lattice) -> np.ndarray:
    """[H * U, 6] int32, see kernels/viability.py."""
    ends = _turned(lattice.ends[:, :2]) / lattice.cell
    aside = 0.5 * TURN * np.linalg.norm(lattice.ends[:, :2], axis=1) / lattice.cell
    turn = np.broadcast_to(lattice.ends[:, 2] / TURN, ends.shape[:2])
    boxes = np.empty((*ends.shape[:2], 6), dtype=np.int32)
    for column, middle, spread in (
        (0, ends[..., 0], aside), (2, ends[..., 1], aside), (4, turn, 0.0),
    ):  # fmt: skip
        # cells and headings hold their lower edges: one that does not move stays in its own
        boxes[..., column] = np.floor(middle - spread)
        boxes[..., column + 1] = np.ceil(middle + spread)
    return boxes.reshape(-1, 6)
