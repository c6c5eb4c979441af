"""Random numbers by a hash: they depend on what they are for, not on when they are drawn."""

import taichi as ti


@ti.func
def scrambled(x):
    """A 32-bit integer hash with full avalanche."""
    x ^= x >> ti.u32(16)
    x *= ti.u32(0x7FEB352D)
    x ^= x >> ti.u32(15)
    x *= ti.u32(0x846CA68B)
    x ^= x >> ti.u32(16)
    return x


@ti.func
def stream(seed, particle, turn):
    """What the draws of one particle in one turn begin from."""
    h = scrambled(seed ^ ti.cast(turn, ti.u32) * ti.u32(0x9E3779B9))
    return scrambled(h ^ ti.cast(particle, ti.u32) * ti.u32(0x85EBCA6B))


@ti.func
def drawn(start, node):
    """Two numbers in [0, 1), of 16 bits each, that depend on nothing but stream and node."""
    h = scrambled(start ^ ti.cast(node, ti.u32) * ti.u32(0xC2B2AE35))
    high = ti.cast(ti.cast(h >> ti.u32(16), ti.i32), ti.f32)
    low = ti.cast(ti.cast(h & ti.u32(0xFFFF), ti.i32), ti.f32)
    return high * (1.0 / 65536.0), low * (1.0 / 65536.0)
