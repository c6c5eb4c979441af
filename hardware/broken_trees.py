"""Nested values that were right, once: messages as trees, and what a YAML file holds."""

from __future__ import annotations

import math
import random
from types import SimpleNamespace
from typing import Any

import numpy as np

NUMBERS = (
    math.nan, math.inf, -math.inf, 0.0, -0.0, -1.0, 1e-320, 1e-30, -1e-9, 1e9, 1e30, -1e30, 1e308,
    -1e308, 0, 1, -1, 7, 2**31, -(2**31), 2**32 - 1, 2**64, -(10**30), 10**400,
)  # fmt: skip
"""The last is more than a float holds."""
TEXTS = (
    "", "/", "//base_link", "base_link", "laser", "odom", "map", "nobody", "\x00", "\ud800", "1e3",
    "nan", "x" * 5000, "- [", "{",
)  # fmt: skip
"""Names that are in use make loops of frames."""
THINGS: tuple[Any, ...] = (
    None, True, False, 3, 0.5, "text", b"bytes", (), [], {}, [[]], {"x": 1}, {3: 4}, [None], object
)  # fmt: skip
"""Of a type that may be another than is asked for."""
LONG = 200_000
"""Elements of an array that is very long."""


def broken_tree(tree: Any, draw: random.Random, changes: int = 3) -> Any:
    """A copy of which up to `changes` values are others than they were."""
    root = [_copied(tree)]
    for _ in range(draw.randrange(changes + 1)):
        holder, key = draw.choice(_spots(root))
        if isinstance(holder, dict) and draw.random() < 0.1:
            _rename(holder, key, draw)
        else:
            # copied: what stands in two places would be changed in both
            holder[key] = _copied(_broken(holder[key], draw))
    return root[0]


def as_message(tree: Any) -> Any:
    """What has a tree's fields as attributes, as messages do."""
    if isinstance(tree, dict) and all(isinstance(name, str) for name in tree):
        return SimpleNamespace(**{name: as_message(value) for name, value in tree.items()})
    return [as_message(part) for part in tree] if isinstance(tree, list) else tree


def _copied(tree: Any) -> Any:
    """Its dicts and lists anew; what is within is never changed in place."""
    if isinstance(tree, dict):
        return {name: _copied(value) for name, value in tree.items()}
    return [_copied(part) for part in tree] if isinstance(tree, list) else tree


def _spots(tree: Any) -> list[tuple[Any, Any]]:
    """(holder, key) of every value."""
    found = []
    waiting = [tree]
    while waiting:
        holder = waiting.pop()
        keys = holder.keys() if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            found.append((holder, key))
            if isinstance(holder[key], (dict, list)):
                waiting.append(holder[key])
    return found


def _rename(holder: dict[Any, Any], key: Any, draw: random.Random) -> None:
    value = holder.pop(key)
    if draw.random() < 0.5:
        holder[draw.choice(("", 3, f"{key}s", "x" * 99))] = value


def _broken(value: Any, draw: random.Random) -> Any:
    # values of the right type lead farther in
    if draw.random() < 0.15:
        return draw.choice(THINGS)
    if isinstance(value, bool):
        return not value
    if isinstance(value, (int, float)):
        return draw.choice((*NUMBERS, 2 * value, -value, value + 1))
    if isinstance(value, str):
        return draw.choice((*TEXTS, value + "x", "/" + value))
    if isinstance(value, np.ndarray):
        return _broken_array(value, draw)
    if isinstance(value, list):
        longer = [*value, draw.choice(THINGS)]
        return draw.choice(([], value[:-1], value + value, longer, value[:1] * 40))
    return draw.choice(THINGS)


def _broken_array(value: np.ndarray, draw: random.Random) -> Any:
    kind = draw.randrange(10)
    if kind == 0:
        return value[: draw.randrange(len(value) + 1)]
    if kind == 1:
        return np.concatenate([value, value])
    if kind == 2:
        return value.tolist()
    if kind == 3:
        return draw.choice((value[:0], value[None], value.astype(object), value.astype(str)))
    if kind == 4 and draw.random() < 0.05:
        return np.resize(value, LONG) if len(value) else value
    changed = value.copy() if len(value) else np.zeros(1, dtype=value.dtype)
    for _ in range(draw.randrange(1, 4)):
        at = draw.randrange(len(changed))
        if changed.dtype.kind == "f":
            # what is more than the array's own kind holds is infinite in it
            with np.errstate(over="ignore"):
                changed[at:] = np.float64(draw.choice(NUMBERS[:19]))
        else:
            changed[at] = draw.choice((0, 1, 99, 100, 101, 127, -1, -128))
    return changed
