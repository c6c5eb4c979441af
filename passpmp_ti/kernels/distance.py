"""Exact Euclidean distances between cells, without OpenCV.

Two passes: down and up each column, then along each row over a window that shrinks as soon as no
farther column can be nearer. Exact, unlike chamfer masks and jump flooding, which over-estimate
and would free cells that are not free.
"""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

FAR = 30000  # cells; its square still fits an i32


@kernel
def column_distance(
    # in
    mask: ti.types.ndarray(dtype=ti.u8, ndim=2),  # [J, I]: 0 marks a seed
    # out
    column: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [J, I] cells to the seed in this column
):
    for i in range(mask.shape[1]):
        d = FAR
        for j in range(mask.shape[0]):
            d = ti.min(d + 1, FAR)
            if mask[j, i] == 0:
                d = 0
            column[j, i] = d
        d = FAR
        for back in range(mask.shape[0]):
            j = mask.shape[0] - 1 - back
            d = ti.min(d + 1, column[j, i])
            column[j, i] = d


@kernel
def row_distance(
    # in
    column: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [J, I]
    # out
    distance: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [J, I] cells
):
    for j, i in column:
        best = column[j, i] * column[j, i]
        k = 1
        while k * k < best and (i - k >= 0 or i + k < column.shape[1]):
            if i - k >= 0:
                best = ti.min(best, column[j, i - k] * column[j, i - k] + k * k)
            if i + k < column.shape[1]:
                best = ti.min(best, column[j, i + k] * column[j, i + k] + k * k)
            k += 1
        distance[j, i] = ti.sqrt(ti.cast(best, ti.f32))
