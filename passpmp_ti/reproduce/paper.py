"""What the paper printed: Bouraine & Azouaoui, Robotica 2020, by the number of the table.

Nothing here is ours. Figures were read from the paper's text.
"""

from __future__ import annotations

WEIGHTS = (0.0, 0.1, 0.2, 0.3, 0.5, 1.0)
"""w_d of Table III; w_t = 1 - w_d."""
TABLE_3 = {
    "cost_d": (39.9, 29.4, 29.4, 24.9, 24.9, 24.9),
    "cost_t": (4.8, 4.8, 4.8, 7.2, 7.2, 7.2),
    "f": (4.8, 9.7, 9.7, 12.5, 12.5, 24.9),
}
"""Costs of the best particle: cost_d [m], cost_t [s], f."""

TABLE_4 = {
    "w_d": (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
    "cost_d": (131.1, 29.4, 12.5, 11.9, 30.9, 12.2, 32.4, 11.2),
    "cost_t": (5.3, 4.8, 5.3, 5.3, 5.3, 4.8, 5.3, 5.3),
    "f": (17.9, 9.7, 7.4, 7.9, 18.1, 9.2, 24.2, 10.0),
    "farther": (17.0, 4.5, 3.4, 2.2, 1.6, 1.1, 0.7, 0.4),
    "sooner": (1.9, 2.4, 1.9, 1.9, 1.9, 2.4, 1.9, 1.9),
}
"""Eight goals, each with its best weights: as Table III, and `farther`, Diff_d+ [m], `sooner`,
Diff_t- [s]."""

SPEEDS = (5.0, 10.0, 20.0, 30.0, 40.0, 50.0)
"""v_b of Table V [m/s]."""
TABLE_5 = (0.357, 0.342, 0.318, 0.21, 0.16, 0.118)
"""Share of p-safe states."""

CYCLES = (0.3, 1.5, 2.5, 3.5, 4.5, 5.5)
"""delta_c of Table VI [s]."""
TABLE_6_NODES = (1, 13, 40, 135, 176, 237)
TABLE_6_DURATIONS = (0.0, 1.76, 2.64, 3.52, 7.12, 8.0)
"""delta_e of Table VI [s]."""
PRIMITIVE = 0.88
"""Seconds of a primitive [s]: durations of Table VI are multiples of it up to 3.52 s."""
LEVELS = 9
"""Most primitives of a plan: 9 x 0.88 s = 7.92 s, near the longest duration of Table VI."""

TABLE_7 = {"passpmp-pso": 29.0, "iss": 65.0}
"""Average running time [ms]."""

PARTICLES = 100
"""Swarm size (Sec. 5.1.2)."""
ENOUGH_PARTICLES = 20
"""From so many on the optimum is found in 100 of 100 runs (Sec. 5.1.3)."""
W_D, W_T = 0.2, 0.8
"""The weights that the paper settles on (Sec. 5.1.3)."""
LONG_CYCLES = (1.4, 2.4)
"""delta_cycle of Figs. 12 and 10 [s]."""
TOP_SPEED, SIGHT = 20.0, 80.0
"""Of objects [m/s], and range of the range finder [m] (Sec. 5.1.1)."""
CHAIR_CYCLE = 0.4
"""delta_cycle of the wheelchair's experiments [s] (Sec. 5.2)."""
