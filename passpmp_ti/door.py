"""Checks at the door: every refusal names the value, the rule and the remedy."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

import numpy as np


def finite(
    owner: str,
    name: str,
    value: object,
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    unit: str = "",
) -> float:
    """Return `value` as a float, or refuse it.

    Args:
        owner: the class or function whose field it is.
        name: the field.
        value: what was given.
        above: the value must be greater than this.
        least: the value must be at least this.
        most: the value must be at most this.
        unit: for the message.

    Raises:
        ValueError: not a finite number, or outside the limits.
    """
    rules = []
    if above is not None:
        rules.append(f"> {above:g}")
    if least is not None:
        rules.append(f">= {least:g}")
    if most is not None:
        rules.append(f"<= {most:g}")
    rule = " and ".join(["finite", *rules]) + (f" [{unit}]" if unit else "")
    refusal = ValueError(f"{owner}.{name} must be {rule}; got {value!r}")
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise refusal
    try:
        number = float(value)
    except OverflowError:  # a whole number of more than 308 digits
        raise refusal from None
    if not math.isfinite(number):
        raise refusal
    if above is not None and not number > above:
        raise refusal
    if least is not None and number < least:
        raise refusal
    if most is not None and number > most:
        raise refusal
    return number


def whole(owner: str, name: str, value: object, *, least: int, most: int | None = None) -> int:
    """Return `value` as an int between `least` and `most`, or refuse it."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)):
        raise ValueError(f"{owner}.{name} must be a whole number; got {value!r}")
    if value < least or (most is not None and value > most):
        rule = f">= {least}" + (f" and <= {most}" if most is not None else "")
        raise ValueError(f"{owner}.{name} must be {rule}; got {value!r}")
    return int(value)


def text(owner: str, name: str, value: object) -> str:
    """Return `value` if it is a text, or refuse it."""
    if not isinstance(value, str):
        raise ValueError(f"{owner}.{name} must be a text; got {value!r}")
    return value


def choice(owner: str, name: str, value: object, allowed: Iterable[str]) -> str:
    """Return `value` if it is one of `allowed`; otherwise refuse it and suggest the nearest."""
    options = list(allowed)
    if isinstance(value, str) and value in options:
        return value
    raise ValueError(
        f"{owner}.{name} must be one of {', '.join(options)}; got {value!r}"
        f"{nearest(value, options)}"
    )


def nearest(given: object, options: Iterable[str]) -> str:
    """A hint `; did you mean X?` where an option is close to what was given, else nothing."""
    close = difflib.get_close_matches(str(given), list(options), n=1, cutoff=0.5)
    return f"; did you mean {close[0]!r}?" if close else ""


def array(owner: str, name: str, value: object, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return `value` as a finite float64 array of `shape` (None: any length), or refuse it.

    Raises:
        ValueError: wrong shape, or an element that is not finite (its index is named).
    """
    try:
        given = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as cause:
        raise ValueError(f"{owner}.{name} must be numbers; got {value!r}") from cause
    wanted = "(" + ", ".join("n" if n is None else str(n) for n in shape) + ")"
    if given.ndim != len(shape) or any(
        n is not None and n != m for n, m in zip(shape, given.shape, strict=False)
    ):
        raise ValueError(f"{owner}.{name} must have shape {wanted}; got {given.shape}")
    bad = np.argwhere(~np.isfinite(given))
    if len(bad):
        at = ", ".join(str(i) for i in bad[0])
        raise ValueError(
            f"{owner}.{name}[{at}] = {given[tuple(bad[0])]}: must be finite ({len(bad)} bad)"
        )
    return given
