"""Watches the planner and writes a certificate of what it holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from passpmp_ti import door
from passpmp_ti.certificate.content import assumptions_of, document_of, robot_of
from passpmp_ti.planner.navigator import Navigator
from passpmp_ti.scan import Scan
from passpmp_verify.certificate import Moment
from passpmp_verify.document import write
from passpmp_verify.gridless import Gridless
from passpmp_verify.motion import spans_of
from passpmp_verify.premises import contradiction
from passpmp_verify.proof import prove
from passpmp_verify.reader import robot_from
from passpmp_verify.verify import model_of


@dataclass(slots=True, eq=False)
class _Seen:
    """A moment, and its model once somebody asked for it."""

    moment: Moment
    model: Gridless | None = field(default=None)


class CertificateWriter:
    """Writes a certificate of each cycle that it is shown; it must see all of them.

    The planner remembers all that it ever proved. The writer keeps the last scans, and puts those
    into a certificate that its path needs. Where a path needs what was dropped, the certificate
    is written all the same, and the verifier says where the path could not be proven.

    Args:
        folder: where the files go; made if it is not there.
        every: write in every n-th cycle only.
        history: how many instants are kept; the older half is thinned out.
    """

    def __init__(self, folder: str | Path, *, every: int = 1, history: int = 64) -> None:
        owner = "CertificateWriter"
        self._every = door.whole(owner, "every", every, least=1)
        self._most = door.whole(owner, "history", history, least=8)
        self._folder = Path(folder)
        self._folder.mkdir(parents=True, exist_ok=True)
        self._seen: list[_Seen] = []  # newest first
        self._cycles = 0

    def see(
        self, scans: Scan | Sequence[Scan], state: np.ndarray, navigator: Navigator
    ) -> Path | None:
        """Look at a cycle, after `Navigator.update` has answered.

        Args:
            scans: what the planner was given.
            state: [5] the robot's state then.
            navigator: the planner.

        Returns:
            The file written; None where this is not the n-th cycle, or no scan was ever used.

        Raises:
            ValueError: a robot of a kind that the verifier does not know.
            OSError: the file cannot be written.
        """
        self._remember([scans] if isinstance(scans, Scan) else list(scans), state, navigator)
        index, self._cycles = self._cycles, self._cycles + 1
        if index % self._every or not self._seen:
            return None
        path = self._folder / f"cycle-{index:05d}.json"
        write(path, self._document(navigator))
        return path

    def _remember(self, scans: list[Scan], state: np.ndarray, navigator: Navigator) -> None:
        record = navigator.record
        if record.model is None:
            return  # the planner could not use them
        if record.forgot or len(record.broken_premises):
            # the planner does not rely on what was before, or on less of it
            self._seen.clear()
        views = record.model.views
        declared_clear = len(views.beams) - views.scans > len(navigator.robot.discs)
        x, y, theta = (float(v) for v in state[:3])
        moment = Moment(
            scans=tuple(scans),
            position=(x, y, theta),
            clear_radius=navigator.settings.clear_radius if declared_clear else 0.0,
            # a robot that is off its plan does not know where it is on the map
            on_map=not (record.forgot and record.decision == "brake"),
        )
        self._seen.insert(0, _Seen(moment))
        if len(self._seen) > self._most:
            self._thin_out()

    def _thin_out(self) -> None:
        """Drop an instant of the older half: the one that leaves the smallest gap. The oldest may
        hold a declared clearing and stays."""
        stamps = np.array([seen.moment.stamp for seen in self._seen])
        half = len(stamps) // 2
        gaps = stamps[half - 1 : -2] - stamps[half + 1 :]
        del self._seen[half + int(np.argmin(gaps))]

    def _document(self, navigator: Navigator) -> dict[str, Any]:
        held, settings, record = navigator.held, navigator.settings, navigator.record
        assert held is not None
        assumptions = assumptions_of(settings)
        robot = robot_from(robot_of(navigator.robot))
        begin = max(held.start, self._seen[0].moment.stamp)
        spans = spans_of(robot, held.times, held.states, begin, assumptions.margin)

        def models() -> Iterator[Gridless]:
            for seen in self._seen:
                if seen.model is None:
                    seen.model = model_of(seen.moment, robot, assumptions, navigator.static_map)
                yield seen.model

        while True:
            # the newest is what the cycle rests on, needed or not
            needed = sorted({0, *prove(spans, models()).used})
            chosen = [self._seen[k] for k in needed]
            moments = [seen.moment for seen in chosen]
            broken = [
                seen
                for k, seen in enumerate(chosen)
                if seen.model is not None and contradiction(seen.model, moments[:k], assumptions)
            ]
            if not broken:
                break
            self._seen = [seen for seen in self._seen if seen not in broken]
        return document_of(
            navigator.robot, settings, navigator.static_map, moments, held,
            {"stamp": record.stamp, "decision": record.decision, "reason": record.reason},
        )  # fmt: skip
