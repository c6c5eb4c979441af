"""Named kinds of bases: what makes each, and what a configuration has to say for it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hardware.base import BaseLimits


@dataclass(frozen=True, slots=True)
class BaseKind:
    """One kind of base."""

    build: str
    """What makes it, "module:function", in the executor's process."""
    fields: Mapping[str, tuple[type, str]]
    """What its section has besides what all have: (kind of value, what it is)."""
    options: Callable[[Mapping[str, Any], BaseLimits], dict[str, Any]]
    """What `build` is called with, from those fields and the base's limits. Raises ValueError at
    fields that make no sense."""
    reach: Callable[[Mapping[str, Any]], str]
    """Where it is looked for, for people."""


def _socket(fields: Mapping[str, Any], limits: BaseLimits) -> dict[str, Any]:
    address = Path(fields["address"])
    if not address.is_absolute():
        raise ValueError(
            f"base.address must be a path from the root, as /run/user/{os.geteuid()}/chair/base:"
            f" the executor need not run in this folder; got {fields['address']!r}"
        )
    return {"address": str(address), **asdict(limits)}


def _simulated(fields: Mapping[str, Any], limits: BaseLimits) -> dict[str, Any]:
    return {"limits": asdict(limits)}


KINDS: dict[str, BaseKind] = {
    "simulated": BaseKind(
        "hardware.simulated_base:build", {}, _simulated, lambda fields: "simulated"
    ),
    "socket": BaseKind(
        "hardware.base_link:build",
        {"address": (str, "the socket at which a BaseServer listens")},
        _socket,
        lambda fields: str(fields["address"]),
    ),
}
"""By the name that a configuration gives. "simulated": wheels that are none; "socket": whatever
another process serves by `BaseServer`."""
