"""What no failure in so many tries proves: one-sided 95 % upper bounds."""

from __future__ import annotations

from scipy.stats import beta, chi2

CONFIDENCE = 0.95


def share_bound(failures: int, tries: int) -> float:
    """Upper bound of the share of tries that fail (Clopper-Pearson); 1 where nothing was tried.

    With no failure it is 1 - 0.05^(1/n), about 3 / n.
    """
    if failures >= tries:
        return 1.0
    return float(beta.ppf(CONFIDENCE, failures + 1, tries - failures))


def rate_bound(events: int, exposure: float) -> float:
    """Upper bound of events per unit of exposure (exact Poisson); inf where there is none.

    With no event it is -ln(0.05) / exposure, about 3 / exposure.
    """
    if exposure <= 0:
        return float("inf")
    return float(chi2.ppf(CONFIDENCE, 2 * (events + 1))) / 2 / exposure
