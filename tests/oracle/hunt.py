"""Properties searched by Hypothesis: short by default, long as a campaign."""

from __future__ import annotations

import os

from hypothesis import HealthCheck, given, settings

EXAMPLES = max(int(os.environ.get("PASSPMP_CAMPAIGN", "2000000")) // 1000, 1)
"""Examples of each property in a campaign."""


class Hunt:
    """The properties of one test module, so that a campaign can search each of them longer."""

    def __init__(self):
        self.properties = {}

    def searched(self, examples, *strategies):
        """A test of `examples` drawn from the strategies, the same ones in every run."""

        def wrap(function):
            self.properties[function.__name__] = (function, strategies)
            return _test(function, strategies, examples)

        return wrap

    def at_length(self, name):
        """One property, as long as the campaign says."""
        function, strategies = self.properties[name]
        _test(function, strategies, EXAMPLES)()


def _test(function, strategies, examples):
    slow = [HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much]
    limits = settings(
        max_examples=examples, deadline=None, derandomize=True, database=None,
        suppress_health_check=slow,
    )  # fmt: skip
    return limits(given(*strategies)(function))
