"""A sum that any backend must get right."""

import taichi as ti


@ti.kernel
def add_up(
    # in
    whole: ti.types.ndarray(dtype=ti.i32, ndim=1),  # [N]
    real: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [N]
    # out
    total: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [N]
):
    for n in total:
        total[n] = real[n] * 0.5 + ti.cast(whole[n] & 255, ti.f32)
