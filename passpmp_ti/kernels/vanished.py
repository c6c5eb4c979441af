"""Whether all of the square about a place is proven empty."""

import taichi as ti

from passpmp_ti.kernels.launch import kernel


@kernel
def squares_empty(
    # in
    seen: ti.types.ndarray(dtype=ti.u8, ndim=2),  # [J, I] 1: proven empty
    squares: ti.types.ndarray(dtype=ti.i32, ndim=2),  # [N, 3] row, column, cells to each side
    # out
    empty: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N] 1: all of it is; it lies in the grid
):
    ti.loop_config(parallelize=1)  # they are few, and mostly answered by the first cell
    for n in range(squares.shape[0]):
        reach = squares[n, 2]
        all_seen = True
        j = squares[n, 0] - reach
        while all_seen and j <= squares[n, 0] + reach:
            i = squares[n, 1] - reach
            while all_seen and i <= squares[n, 1] + reach:
                all_seen = seen[j, i] != 0
                i += 1
            j += 1
        empty[n] = ti.cast(all_seen, ti.i32)
