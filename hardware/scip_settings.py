"""What a user says of a range finder and of how it is to be read."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from hardware.scip import PORT
from hardware.scip_commands import MOST_CLUSTER, MOST_STEPS
from hardware.scip_sweep import UST_CODES, Codes
from passpmp_ti import door


@dataclass(frozen=True, slots=True, kw_only=True)
class ScipSettings:
    """One range finder on the network, and what may be relied on about it."""

    host: str
    """Its address in numbers, as 192.168.0.10, which is how a UST is delivered."""
    port: int = PORT

    # what it measures
    range_max: float = 10.0
    """How far "no return" is taken for empty space, and beyond which returns do not count [m]. A
    UST-10LX claims 30 m and promises 10 m against what is white, 4 m against what is dark."""
    start: int | None = None
    """First step; None: the device's first."""
    end: int | None = None
    """Last step, included; None: the device's last."""
    cluster: int = 1
    """Steps that share a value."""
    skip: int = 0
    """Sweeps left out after each one."""
    intensities: bool = False
    """Ask for intensities too, at twice the bytes."""
    streams: bool = True
    """True: the device sends sweep after sweep (MD, ME); False: each one is asked for (GD, GE)."""
    codes: Codes = UST_CODES
    """What numbers that are no distances mean."""
    upside_down: bool = False
    """Mounted on its head: it counts clockwise then, seen from above."""

    # time
    stamp_error: float = 0.03
    """No beam of a scan that is handed out was measured earlier than this before the scan's stamp
    [s]; what cannot be promised that is not handed out. Give the planner's `Settings` the same."""
    drift: float = 1e-4
    """Greatest relative difference in rate of the device's clock and this machine's."""
    clock_samples: int = 10
    """Times that the device is asked for its clock when the clocks are compared."""
    clock_every: float = 30.0
    """Time from one comparison to the next [s]; two or three sweeps are lost to each."""
    late: float = 0.05
    """A scan that arrives longer than this after its stamp is counted as late [s]."""

    # when something is wrong
    answer_within: float = 0.5
    """The link is given up if a command is not answered for this long [s]."""
    silent_after: float = 0.25
    """The link is given up if no whole sweep comes for this long [s]."""
    garbled_most: int = 5
    """The link is given up after this many replies in a row that cannot be read."""
    frozen_after: int = 0
    """Sweeps in a row with the very same distances from which on they are not handed out: a real
    device has noise. 0: they always are, as a simulated one needs."""
    retry_first: float = 0.1
    """Time to the first attempt to connect again [s]; it doubles with each that fails."""
    retry_most: float = 2.0
    """Longest such time [s]; it begins anew once sweeps have come for as long as this."""

    def __post_init__(self) -> None:
        name = "ScipSettings"
        try:
            ipaddress.ip_address(self.host)
        except ValueError:
            raise ValueError(
                f"{name}.host must be an address in numbers, as '192.168.0.10': looking a name up"
                f" could take longer than a scan; got {self.host!r}"
            ) from None
        door.whole(name, "port", self.port, least=1, most=65535)
        for field in ("start", "end"):
            if getattr(self, field) is not None:
                door.whole(name, field, getattr(self, field), least=0, most=MOST_STEPS)
        door.whole(name, "cluster", self.cluster, least=1, most=MOST_CLUSTER)
        door.whole(name, "skip", self.skip, least=0, most=9)
        for field in ("garbled_most", "clock_samples"):
            door.whole(name, field, getattr(self, field), least=1)
        door.whole(name, "frozen_after", self.frozen_after, least=0)
        for field in (
            "range_max", "stamp_error", "clock_every", "late", "answer_within", "silent_after",
            "retry_first",
        ):  # fmt: skip
            door.finite(name, field, getattr(self, field), above=0.0)
        door.finite(name, "retry_most", self.retry_most, least=self.retry_first, unit="s")
        door.finite(name, "drift", self.drift, least=0.0, most=0.01)
