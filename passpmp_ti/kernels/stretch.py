"""Marks are few: the stretches of a row that hold none are passed over."""

import taichi as ti

STRETCH = 64
"""Cells of a row that are looked at together."""


@ti.func
def bare(marks: ti.template(), one, other, j, begin):
    """Whether the stretch of row j from `begin` on holds no marks of two kinds, told quickly.

    marks: u8 [K, J, I], 0 marks.
    """
    unmarked = ti.u8(1)
    for i in range(begin, ti.min(begin + STRETCH, marks.shape[2])):
        unmarked &= marks[one, j, i] & marks[other, j, i]
    return unmarked != 0
