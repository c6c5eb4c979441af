"""The charts of a comparison's page, one scenario each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from passpmp_ti.compare.axes import Axes, Axis, legend
from passpmp_ti.compare.intervals import CONFIDENCE
from passpmp_ti.compare.reliability import DECADES
from passpmp_ti.compare.rows import percent
from passpmp_ti.compare.summary import Group
from passpmp_ti.compare.svg import Drawing

WIDTH, HEIGHT = 560.0, 340.0
LEFT, RIGHT, TOP, BOTTOM = 60.0, 20.0, 36.0, 74.0
NAMES = 130.0
"""Room for the names of rows [px]."""
ROW = 46.0
LEAST_CONTACT_AXIS = 0.05
FLOOR = 10.0**-DECADES / 10**0.5
"""Where the logarithmic axes of the reliability diagram begin; what is less stands there."""


def contacts_chart(groups: Mapping[str, Group]) -> str:
    """Share of episodes with a contact while moving, with intervals."""
    most = max([LEAST_CONTACT_AXIS, *(1.05 * g["contact_high"] for g in groups.values())])
    rows = [
        (g["contact_low"], g["contact_share"], g["contact_high"],
         f"{g['contact_episodes']} of {g['episodes']}")
        for g in groups.values()
    ]  # fmt: skip
    axis = Axis(
        low=0.0, high=min(most, 1.0), percent=True,
        label=f"episodes with a contact while moving, {percent(CONFIDENCE, '.0%')} interval",
    )  # fmt: skip
    return _rows_chart("Contacts while moving", list(groups), rows, axis)


def cost_chart(groups: Mapping[str, Group]) -> str:
    """Time of a cycle: the median, and up to what 99 % take."""
    told = [(g["cost_median"], g["cost_p99"]) for g in groups.values()]
    most = max([1e-3, *(p99 for _, p99 in told if p99 is not None)])
    rows = [
        (
            None if median is None else 1e3 * median,
            None if median is None else 1e3 * median,
            None if p99 is None else 1e3 * p99,
            "" if median is None or p99 is None else f"{1e3 * median:.1f} ms, {1e3 * p99:.1f} ms",
        )
        for median, p99 in told
    ]
    axis = Axis(low=0.0, high=1.05e3 * most, label="a cycle [ms]: median, and up to 99 %")
    return _rows_chart("Cost of a cycle", list(groups), rows, axis)


def arrival_chart(groups: Mapping[str, Group], longest: float) -> str:
    """Share of episodes that have reached the goal, against time; `longest`: of an episode [s]."""
    drawing = Drawing((WIDTH, HEIGHT), "Share of episodes at the goal, against time")
    latest = [s["time_to_goal"] or 0.0 for g in groups.values() for s in g["seeds"].values()]
    if any(latest):
        longest = min(longest, 1.2 * max(latest))  # nothing happens after the last arrival
    axes = _axes(
        Axis(low=0.0, high=longest, label="time [s]"),
        Axis(low=0.0, high=1.0, label="at the goal by then", percent=True),
    )
    axes.draw(drawing)
    for n, (name, group) in enumerate(groups.items()):
        seeds = group["seeds"].values()
        times = sorted(s["time_to_goal"] for s in seeds if s["time_to_goal"] is not None)
        if not seeds:
            continue
        steps, share = [axes.at(0.0, 0.0)], 0.0
        for k, time in enumerate(times):
            steps.append(axes.at(time, share))
            share = (k + 1) / len(seeds)
            steps.append(axes.at(time, share))
        steps.append(axes.at(longest, share))
        drawing.line(steps, f"curve v{n % 6}")
        # a mark where half of those that arrive have arrived
        if times:
            middle = len(times) // 2
            at = axes.at(times[middle], (middle + 1) / len(seeds))
            drawing.mark(at, n, f"mark v{n % 6}", f"{name}: {times[middle]:.1f} s")
    legend(drawing, (LEFT, HEIGHT - 4), list(groups), WIDTH)
    return drawing.svg()


def reliability_chart(groups: Mapping[str, Group]) -> str:
    """How often it came to a contact, against the risk promised; both logarithmic."""
    drawing = Drawing((WIDTH, HEIGHT), "Risk promised against risk met")
    axes = _axes(
        Axis(low=FLOOR, high=1.0, log=True, label="risk promised (at the left end: none)"),
        Axis(low=FLOOR, high=1.0, log=True, label="risk met (at the lower end: never)"),
    )
    axes.draw(drawing)
    drawing.area([axes.at(FLOOR, FLOOR), axes.at(1, 1), axes.at(FLOOR, 1)], "bad")
    drawing.line([axes.at(FLOOR, FLOOR), axes.at(1, 1)], "even")
    drawing.words((LEFT + 10, TOP + 18), "met more than promised", "hint")
    for n, (name, group) in enumerate(groups.items()):
        aside = 9.0 * (n - 0.5 * (len(groups) - 1))  # bins of several variants beside each other
        for b in group["promises"]["bins"]:
            x = axes.across(b["promised"]) + aside
            kind = f"v{n % 6}"
            drawing.line([(x, axes.up(b["share_low"])), (x, axes.up(b["share_high"]))],
                         f"bar thin {kind}")  # fmt: skip
            tip = (
                f"{name}: promised {b['promised']:.2g}, met {b['met']} of {b['count']}"
                f" = {b['share']:.2g}"
            )
            drawing.mark((x, axes.up(b["share"])), n, f"mark {kind}", tip)
    legend(drawing, (LEFT, HEIGHT - 4), list(groups), WIDTH)
    return drawing.svg()


def _axes(x: Axis, y: Axis) -> Axes:
    return Axes(x, y, (LEFT, TOP, WIDTH - RIGHT, HEIGHT - BOTTOM))


def _rows_chart(
    title: str,
    names: Sequence[str],
    rows: Sequence[tuple[float | None, float | None, float | None, str]],
    axis: Axis,
) -> str:
    """One row a variant: a bar from low to high, a mark between them, and words."""
    height = 24.0 + ROW * len(names) + 50
    drawing = Drawing((WIDTH, height), title)
    axes = Axes(axis, None, (NAMES, 16.0, WIDTH - RIGHT, height - 50))
    axes.draw(drawing)
    for n, (name, (low, middle, high, words)) in enumerate(zip(names, rows, strict=True)):
        y = 16.0 + ROW * (n + 0.62)
        drawing.words((NAMES - 12, y + 4), name, "name", "end")
        if low is None or middle is None or high is None:
            continue
        drawing.line([(axes.across(low), y), (axes.across(high), y)], f"bar v{n % 6}")
        drawing.mark((axes.across(middle), y), n, f"mark v{n % 6}", f"{name}: {words}")
        end = axes.across(high)
        inside = end > 0.5 * (NAMES + WIDTH)
        at = (end, y - 10) if inside else (end + 10, y + 4)
        drawing.words(at, words, "tick", "end" if inside else "start")
    return drawing.svg()
