"""What became of broken inputs, and how inputs are broken: what all fuzzers share."""

from __future__ import annotations

import argparse
import random
import resource
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

LONGEST = 1.0
"""[s] of this thread's work that an input may take."""
MOST_TOLD = 2000
"""Characters of an input that failed."""


@dataclass(slots=True)
class Findings:
    """What became of the inputs."""

    inputs: dict[str, int] = field(default_factory=dict)
    refused: int = 0
    """Inputs that the protocol itself refused."""
    failures: list[str] = field(default_factory=list)
    """What was raised that may not be, and over what."""
    slowest: float = 0.0
    """[s]."""
    slowest_target: str = ""

    def throw(
        self,
        name: str,
        count: int,
        made: Callable[[], Any],
        eat: Callable[[Any], object],
        refusal: type[Exception] | tuple[()],
    ) -> None:
        """Let a target eat `count` inputs, one after the other; see `attempt`.

        Args:
            made: makes the next input.
            eat: hands one over.
        """
        self.inputs[name] = count
        for _ in range(count):
            data = made()
            self.attempt(name, data, partial(eat, data), refusal)

    def attempt(
        self,
        name: str,
        data: object,
        eat: Callable[[], object],
        refusal: type[Exception] | tuple[()],
    ) -> None:
        """Let a target eat an input, and note what came of it.

        Args:
            name: of the target.
            data: the input, for the report.
            eat: hands it over.
            refusal: what the protocol itself may raise; (): nothing.
        """
        began = time.thread_time()
        try:
            eat()
        except refusal:
            self.refused += 1
        except Exception:
            self.failures.append(f"{name}: {_told(data)}\n{traceback.format_exc(limit=4)}")
        took = time.thread_time() - began
        if took > self.slowest:
            self.slowest, self.slowest_target = took, name
        if took > LONGEST:
            self.failures.append(f"{name}: {took:.1f} s for {_told(data)}")


def _told(data: object) -> str:
    told = repr(data)
    return told if len(told) <= MOST_TOLD else f"{told[:MOST_TOLD]}... ({len(told)} characters)"


def broken(right: list[bytes], draw: random.Random) -> bytes:
    """An input that was right, once."""
    if draw.random() < 0.1:
        return draw.randbytes(draw.randrange(200))
    data = bytearray(draw.choice(right))
    for _ in range(draw.randrange(4)):
        at = draw.randrange(len(data) + 1)
        kind = draw.randrange(6)
        if kind == 0 and at < len(data):
            data[at] = draw.randrange(256)
        elif kind == 1:
            del data[at : at + draw.randrange(1, 9)]
        elif kind == 2:
            data[at:at] = data[at : at + draw.randrange(1, 70)]
        elif kind == 3:
            del data[at:]
        elif kind == 4:
            data += draw.choice(right)
        else:
            data[at:at] = draw.choice((b"\n", b"\n\n", b"\r", b";", b"\x00", b"\xff", b"9", b"-1"))
    return bytes(data)


def carry_out(
    description: str, module: str, fuzz: Callable[[int, random.Random], Findings]
) -> int:
    """The command of a fuzzer: read what is asked, throw, tell. Returns the exit code."""
    parser = argparse.ArgumentParser(
        description=description, epilog=f"example: python -m {module} --inputs 100000 --seed 7"
    )
    parser.add_argument("--inputs", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    findings = fuzz(given.inputs, random.Random(given.seed))
    for name, number in findings.inputs.items():
        print(f"{name:8s} {number:9,d} inputs")
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    print(
        f"{findings.refused:,d} refused by the protocol, {len(findings.failures)} failures;"
        f" {time.perf_counter() - began:.0f} s, the slowest {1000 * findings.slowest:.1f} ms"
        f" of work ({findings.slowest_target}); {grown:.0f} MB more memory at the most"
    )
    for failure in findings.failures[:10]:
        print(failure)
    return 1 if findings.failures else 0
