"""Pieces of work in an order that gives every thread of a CPU as much to do as the others.

A thread is handed a long run of a loop's indices, and pieces of work beside each other are often
alike: all quick, or all slow.
"""

import taichi as ti

PARTS = 64
"""Runs that the order is made of; more threads than these find less even shares."""


@ti.func
def spread_over(count):
    """How many indices a loop over `count` pieces of work takes."""
    return (count + PARTS - 1) // PARTS * PARTS


@ti.func
def spread(index, count):
    """The piece of work of an index; `count` and more: there is none."""
    along = spread_over(count) // PARTS
    return index % along * PARTS + index // along


@ti.func
def evens_first(index, count):
    """0, 2, 4, ... and then 1, 3, ... below `count`: for pieces that come in columns."""
    piece = 2 * index
    if piece >= count:
        piece -= count - (count + 1) % 2
    return piece
