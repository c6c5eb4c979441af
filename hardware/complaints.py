"""What to look at when a range finder does not answer, by what the connection said."""

from __future__ import annotations

import socket

from hardware.scip_settings import ScipSettings

ADVICE = (
    (
        "refused",
        "the address answers, its port does not: it serves one host at a time, so end whatever else"
        " reads it (another driver, another drive); or it is still starting, which takes some"
        " seconds",
    ),
    (
        "closed the connection",
        "it hung up: another host may be connected, since it serves one at a time",
    ),
    (
        "unreachable",
        "this machine has no way to that network: give its Ethernet port an address beside the"
        " device's, as 192.168.0.15/24",
    ),
    (
        "No route",
        "nobody has that address: is it powered, is the cable in, was its address changed?",
    ),
    (
        "within the time allowed",
        "nobody answers there: is it powered, is the cable in, is this machine's Ethernet port in"
        " the same network, was the device's address changed?",
    ),
    (
        "nothing usable",
        "it is connected and sends nothing: is its window clear of the cover, does it say an error"
        " (python -m hardware.scip_look ADDRESS)?",
    ),
    (
        "clock",
        "its clock and this machine's do not keep together: is this machine so busy that answers"
        " come late, was the device reset?",
    ),
)
"""(what a connection's trouble has in it, what to look at)."""


def advice(settings: ScipSettings, trouble: str) -> str:
    """What to look at.

    Args:
        settings: of the range finder.
        trouble: why the last connection, or attempt, ended; "" before any did.
    """
    if _is_own(settings.host):
        return (
            f"{settings.host} is an address of this machine: it hides the device's; give this"
            " machine another one in the same network"
        )
    found = [told for mark, told in ADVICE if mark in trouble]
    return found[0] if found else "look at it with python -m hardware.scip_look ADDRESS"


def _is_own(host: str) -> bool:
    """Whether an address is this machine's own, loopback aside, where emulated devices live."""
    if host.startswith("127.") or host == "::1":
        return False
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as one:
        try:
            one.bind((host, 0))
        except OSError:
            return False
    return True
