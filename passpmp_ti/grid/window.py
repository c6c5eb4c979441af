"""Where the grid lies: a square of whole cells that moves with the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

FARTHEST_ANCHOR = 200.0
"""[m] A braking path summed in single precision that far out is off by less than a millimetre."""


@dataclass(frozen=True, slots=True)
class Window:
    """A square of cells. Arrays over it are [j, i] = [y, x].

    Device coordinates are world coordinates less `anchor`, so that single precision is fine-grained
    wherever in the world the robot is. The anchor stays where it is for hundreds of metres, so that
    a point falls into the same cell cycle after cycle, and moves by whole cells.
    """

    size: int
    """Cells along each side."""
    cell: float
    """Side of a cell [m]."""
    corner: tuple[int, int]
    """(i0, j0): cell [0, 0] is the world's cell (i0, j0), counted from the anchor."""
    anchor: tuple[float, float]
    """World position of the outer corner of the anchor's cell (0, 0) [m]."""

    @classmethod
    def around(
        cls, x: float, y: float, size: int, cell: float, anchor: tuple[float, float] | None = None
    ) -> Window:
        """The window whose middle is nearest to (x, y) [m]; an anchor that is None or too far off
        is put there."""
        if anchor is None:
            anchor = (math.floor(x / cell) * cell, math.floor(y / cell) * cell)
        elif math.dist((x, y), anchor) > FARTHEST_ANCHOR:
            across, up = (round((p - a) / cell) for p, a in zip((x, y), anchor, strict=True))
            anchor = (anchor[0] + across * cell, anchor[1] + up * cell)
        corner = tuple(
            math.floor((p - a) / cell + 0.5) - size // 2
            for p, a in zip((x, y), anchor, strict=True)
        )
        return cls(size, cell, (corner[0], corner[1]), anchor)

    @property
    def origin(self) -> tuple[float, float]:
        """World position of the outer corner of cell [0, 0] [m]."""
        return (
            self.anchor[0] + self.corner[0] * self.cell,
            self.anchor[1] + self.corner[1] * self.cell,
        )

    def cells_to(self, other: Window) -> tuple[int, int]:
        """(columns, rows) from the corner of this window to that of another of the same cells."""
        across, up = (
            c - own + round((a - mine) / self.cell)
            for c, own, a, mine in zip(
                other.corner, self.corner, other.anchor, self.anchor, strict=True
            )
        )
        return across, up

    @property
    def inner_radius(self) -> float:
        """A disc of this radius about the window's middle stays clear of its border [m]."""
        return (self.size // 2 - 3) * self.cell


def size_for(sensor_reach: float, cell: float) -> int:
    """Cells along a side so that everything the sensors reach lies inside, in steps of 16."""
    return 16 * math.ceil((2 * sensor_reach / cell + 8) / 16)
