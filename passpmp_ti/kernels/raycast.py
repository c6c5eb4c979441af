"""Nearest surfaces along rays. All coordinates are relative to the sensor: f32 loses nothing."""

import taichi as ti

from passpmp_ti.kernels.launch import kernel

vec2 = ti.types.vector(2, ti.f32)

NOTHING, STATIC, MOVING = 0, 1, 2
"""What a ray met."""

AT_JOINTS = 1e-6  # a ray through the joint of two walls must not slip between them


@ti.func
def meet_segment(ray: vec2, a: vec2, b: vec2) -> ti.f32:
    """Distance along the ray to the segment a b [m]; inf: it passes by."""
    found = ti.math.inf
    along = b - a
    across = ray.cross(along)
    if across != 0.0:
        t = a.cross(along) / across
        share = a.cross(ray) / across
        if t >= 0.0 and share >= -AT_JOINTS and share <= 1.0 + AT_JOINTS:
            found = t
    return found


@ti.func
def meet_disc(ray: vec2, centre: vec2, radius: ti.f32) -> ti.f32:
    """Distance along the ray to a disc that does not hold its start [m]; inf: it passes by."""
    found = ti.math.inf
    ahead = ray.dot(centre)
    aside = ti.abs(ray.cross(centre))
    if ahead > 0.0 and aside < radius:
        # factored: the difference of squares would lose half its digits at grazing rays
        found = ti.max(ahead - ti.sqrt((radius - aside) * (radius + aside)), 0.0)
    return found


@kernel
def cast_rays(
    # in
    rays: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [n, 2] unit vectors
    segments: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [s, 4] x1, y1, x2, y2
    discs: ti.types.ndarray(dtype=ti.f32, ndim=2),  # [d, 3] x, y, radius
    # out
    ranges: ti.types.ndarray(dtype=ti.f32, ndim=1),  # [n] m, inf: nothing
    met: ti.types.ndarray(dtype=ti.u8, ndim=1),  # [n] NOTHING, STATIC, MOVING
):
    for k in range(rays.shape[0]):
        ray = vec2(rays[k, 0], rays[k, 1])
        nearest = ti.math.inf
        what = NOTHING
        for n in range(segments.shape[0]):
            a = vec2(segments[n, 0], segments[n, 1])
            b = vec2(segments[n, 2], segments[n, 3])
            t = meet_segment(ray, a, b)
            if t < nearest:
                nearest = t
                what = STATIC
        for n in range(discs.shape[0]):
            t = meet_disc(ray, vec2(discs[n, 0], discs[n, 1]), discs[n, 2])
            if t < nearest:
                nearest = t
                what = MOVING
        ranges[k] = nearest
        met[k] = ti.u8(what)
