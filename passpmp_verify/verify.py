"""Safe, or where and when not."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from passpmp_verify.certificate import Assumptions, Certificate, Moment
from passpmp_verify.document import DIGEST, digest, read
from passpmp_verify.gridless import Gridless
from passpmp_verify.motion import faults, spans_of
from passpmp_verify.premises import Contradiction, contradiction
from passpmp_verify.proof import Place, Proof, prove
from passpmp_verify.reader import certificate_of
from passpmp_verify.robot import Robot
from passpmp_verify.static_map import StaticMap


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the verifier found."""

    safe: bool
    reason: str
    """Why not; empty where it is safe."""
    begin: float = math.nan
    """From when on the path was judged [s]."""
    end: float = math.nan
    """When the robot is at rest [s]."""
    proof: Proof | None = None
    """Of the path's freedom, if it came to that."""
    contradictions: tuple[Contradiction, ...] = ()
    """Of scans that were not relied on."""

    def told(self) -> str:
        """For people: one line, and one more for each scan that was not relied on."""
        notes = "".join(f"\n  {c.told()}" for c in self.contradictions)
        if not self.safe:
            return f"NOT safe: {self.reason}{notes}"
        if self.proof is None or self.proof.least is None:
            return f"safe: the robot does not move from t = {self.begin:.3f} s on{notes}"
        place = self.proof.least
        return (
            f"safe from t = {self.begin:.3f} s until it is at rest at t = {self.end:.3f} s;"
            f" {place.margin:.3f} m to spare at the least, {_where(place)}{notes}"
        )


def verify_file(path: Path) -> Verdict:
    """Check one file.

    Raises:
        OSError: it cannot be read.
        CertificateError: it is no certificate, or one whose numbers cannot be.
    """
    document = read(path)
    if document.get(DIGEST) != digest(document):
        return Verdict(False, "its content is not what its digest was made of: it was changed")
    return verify(certificate_of(document))


def verify(certificate: Certificate) -> Verdict:
    """Check what a certificate says; its digest is not looked at here."""
    impossible = faults(
        certificate.robot, certificate.times, certificate.states, certificate.brakes_from
    )
    begin, end = certificate.begin, float(certificate.times[-1])
    if impossible:
        time, what = impossible[0]
        return Verdict(False, f"at t = {time:.3f} s {what}", begin, end)
    spans = spans_of(
        certificate.robot, certificate.times, certificate.states, begin,
        certificate.assumptions.margin,
    )  # fmt: skip
    contradicted: list[Contradiction] = []
    proof = prove(spans, _trusted(certificate, contradicted))
    reason = "" if proof.failed is None else _not_free(proof.failed)
    return Verdict(not reason, reason, begin, end, proof, tuple(contradicted))


def _trusted(certificate: Certificate, contradicted: list[Contradiction]) -> Iterator[Gridless]:
    """Models of the moments that no later one contradicts; one after the other, since most paths
    need only the first."""
    for k, moment in enumerate(certificate.moments):
        model = model_of(moment, certificate.robot, certificate.assumptions, certificate.static_map)
        found = contradiction(model, certificate.moments[:k], certificate.assumptions)
        if found is None:
            yield model
        else:
            contradicted.append(found)


def model_of(
    moment: Moment, robot: Robot, assumptions: Assumptions, static_map: StaticMap | None
) -> Gridless:
    """What the scans of one instant prove of the future."""
    x, y, theta = moment.position
    body = [
        (x + offset * math.cos(theta), y + offset * math.sin(theta), radius)
        for offset, radius in robot.discs.tolist()
    ]
    return Gridless(
        moment.scans,
        body,
        (x, y, moment.clear_radius) if moment.clear_radius > 0 else None,
        object_width=assumptions.object_width,
        range_noise=assumptions.range_noise,
        object_speed=assumptions.object_speed,
        blind_speed=assumptions.blind_speed,
        stamp_error=assumptions.stamp_error,
        static_map=static_map if moment.on_map else None,
        map_tolerance=assumptions.map_tolerance,
        localisation_error=assumptions.localisation_error,
        object_radius=assumptions.object_radius,
    )


def _where(place: Place) -> str:
    return f"at t = {place.time:.3f} s, disc {place.disc} at ({place.x:.3f}, {place.y:.3f})"


def _not_free(place: Place) -> str:
    if not math.isfinite(place.room):
        return f"{_where(place)}: no scan is old enough to speak of it"
    have = "nothing" if place.room <= 0 else f"{place.room:.3f} m about it"
    return f"{_where(place)}: {place.need:.3f} m about it must be free, {have} is proven to be"
