"""What so many tries prove: exact 95 % intervals of shares and of medians."""

from __future__ import annotations

from collections.abc import Sequence

from scipy.stats import beta, binom

CONFIDENCE = 0.95


def share_interval(times: int, tries: int) -> tuple[float, float]:
    """Two-sided Clopper-Pearson interval of a share: it holds at least as often as it says.

    Args:
        times: how often it happened.
        tries: out of so many.

    Returns:
        (low, high); (0, 1) where nothing was tried. 0 of n: high = 1 - 0.025^(1 / n).

    Raises:
        ValueError: not 0 <= times <= tries.
    """
    if not 0 <= times <= tries:
        raise ValueError(f"share_interval: {times} of {tries}: it must be 0 <= times <= tries")
    rest = (1 - CONFIDENCE) / 2
    low = 0.0 if times == 0 else float(beta.ppf(rest, times, tries - times + 1))
    high = 1.0 if times == tries else float(beta.ppf(1 - rest, times + 1, tries - times))
    return low, high


def median_interval(values: Sequence[float]) -> tuple[float, float] | None:
    """Interval of the median of what the values were drawn from, whatever its distribution.

    Order statistics: the k-th least and the k-th greatest value, k so large that the median lies
    between them in at least 95 % of all samples.

    Args:
        values: [n], independent.

    Returns:
        (low, high), or None where fewer than six values cannot tell.
    """
    count = len(values)
    # chance that fewer than k of n values lie below the median, twice: both ends
    k = 0
    while k < count // 2 and 2 * float(binom.cdf(k, count, 0.5)) <= 1 - CONFIDENCE:
        k += 1
    if k == 0:
        return None
    ordered = sorted(values)
    return ordered[k - 1], ordered[count - k]
