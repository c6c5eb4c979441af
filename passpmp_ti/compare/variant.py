"""What is compared: a name, and what it changes in a scenario's settings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from passpmp_ti import door
from passpmp_ti.settings import MODES


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One of those that drive through the same worlds."""

    name: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    """Fields of `Settings`."""


def modes(names: Iterable[str]) -> tuple[Variant, ...]:
    """The safety modes of these names as variants.

    Raises:
        ValueError: an unknown mode (the nearest is suggested).
    """
    return tuple(
        Variant(name=name, changes={"mode": door.choice("compare", "modes", name, MODES)})
        for name in names
    )
