"""What a comparison tells: exact intervals, promises judged, and a page that has every number."""

import json
import math
import re
from html import escape
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binom

from passpmp_ti.compare import page, rows, table
from passpmp_ti.compare.axes import legend
from passpmp_ti.compare.findings import findings
from passpmp_ti.compare.intervals import median_interval, share_interval
from passpmp_ti.compare.job import key_of
from passpmp_ti.compare.promise import Promises, moves, would_touch
from passpmp_ti.compare.reliability import reliability
from passpmp_ti.compare.summary import summarise
from passpmp_ti.compare.svg import Drawing
from passpmp_ti.robots import DifferentialDrive
from passpmp_ti.sim.movers import NoMovers, PathMovers
from passpmp_ti.trajectory import Trajectory

CHAIR = DifferentialDrive()


# intervals ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("times", "tries", "interval"),
    [
        (0, 100, (0.0, 1 - 0.025**0.01)),  # 0.0362
        (5, 100, (0.016432, 0.112835)),
        (100, 100, (0.025**0.01, 1.0)),
        (1, 1, (0.025, 1.0)),
        (0, 0, (0.0, 1.0)),
    ],
)
def test_shares_have_clopper_pearson_intervals(times, tries, interval):
    assert share_interval(times, tries) == pytest.approx(interval, abs=1e-6)


def test_what_was_seen_is_just_possible_at_both_ends_of_a_share_interval():
    low, high = share_interval(7, 60)
    assert binom.sf(6, 60, low) == pytest.approx(0.025)
    assert binom.cdf(7, 60, high) == pytest.approx(0.025)


def test_more_than_all_is_refused():
    with pytest.raises(ValueError, match="5 of 4"):
        share_interval(5, 4)


@pytest.mark.parametrize(
    ("count", "interval"), [(5, None), (6, (1, 6)), (10, (2, 9)), (100, (40, 61))]
)
def test_a_median_lies_between_order_statistics(count, interval):
    assert median_interval(list(range(count, 0, -1))) == interval


def test_a_median_interval_holds_as_often_as_it_says():
    rng = np.random.default_rng(1)
    held = [low <= 0 <= high for low, high in map(median_interval, rng.normal(size=(1000, 30)))]
    assert np.mean(held) >= 0.95


# the counterfactual judge ---------------------------------------------------------------------


def straight(speed=1.0, seconds=2.0, step=0.1):
    """Along x from the origin at `speed`, then at rest at once."""
    times = np.arange(0.0, seconds + 1e-9, step)
    states = np.zeros((len(times), 5))
    states[:, 0] = speed * times
    states[:-1, 3:] = speed
    return Trajectory(times, states, len(times) - 1)


def mover(*waypoints, radius=0.2, born=-math.inf):
    return PathMovers([np.array(waypoints)], np.array([radius]), born=np.array([born]))


REACH = CHAIR.radius + 0.2


def test_who_stands_in_the_way_would_be_touched():
    assert would_touch(CHAIR, straight(), mover((0.0, 1.5, 0.0)), 0.0)


@pytest.mark.parametrize(("aside", "touched"), [(REACH - 0.01, True), (REACH + 0.01, False)])
def test_a_touch_is_one_of_discs(aside, touched):
    assert would_touch(CHAIR, straight(), mover((0.0, 1.0, aside)), 0.0) == touched


def test_who_comes_when_the_robot_rests_is_no_contact_while_moving():
    late = mover((2.0, 2.0, 5.0), (4.0, 2.0, 0.0))
    assert not would_touch(CHAIR, straight(), late, 0.0)


def test_who_passes_between_two_samples_is_seen():
    bullet = mover((0.0, 1.05, 21.0), (2.1, 1.05, -21.0))  # 20 m/s, at y = 0 at 1.05 s
    crossing = straight(step=1.0)
    assert would_touch(CHAIR, crossing, bullet, 0.0)


def test_what_was_before_the_plan_begins_is_not_its_fault():
    behind = mover((0.0, 0.0, 0.0))
    assert would_touch(CHAIR, straight(), behind, 0.0)
    assert not would_touch(CHAIR, straight(), behind, REACH + 0.05)


def test_who_is_not_there_is_not_touched():
    assert not would_touch(CHAIR, straight(), mover((0.0, 1.5, 0.0), born=3.0), 0.0)
    assert not would_touch(CHAIR, straight(), NoMovers(), 0.0)


def test_only_every_nth_promise_is_judged_and_only_of_who_moves():
    promises = Promises(every=2)
    for cycle in range(6):
        chosen = straight() if cycle < 4 else Trajectory.resting(np.zeros(5), 0.0)
        record = SimpleNamespace(chosen=chosen, risk=0.1 * cycle)
        navigator = SimpleNamespace(
            robot=CHAIR, record=record, settings=SimpleNamespace(cycle=0.1)
        )
        world = SimpleNamespace(movers=mover((0.0, 1.5, 0.0)))
        promises.see(SimpleNamespace(time=-0.1, navigator=navigator, world=world))
    assert promises.promised == [0.0, 0.2]
    assert promises.met == [1, 1]
    assert not moves(CHAIR, straight(), 2.0)


# reliability ----------------------------------------------------------------------------------


def test_promises_fall_into_half_decades_and_nothing_has_a_bin_of_its_own():
    pairs = [(0.0, 0), (0.0, 0), (1e-9, 0), (0.02, 0), (0.03, 1), (0.04, 0), (1.0, 1)]
    told = reliability(pairs)
    assert (told["judged"], told["met"]) == (7, 2)
    assert told["expected"] == pytest.approx(1.09)
    bins = [(b["low"], b["high"], b["count"], b["met"]) for b in told["bins"]]
    # 10^-2 to 10^-1.5 = 0.0316 and on to 10^-1
    edges = [(0, 0), (0, 1e-6), (1e-2, 10**-1.5), (10**-1.5, 1e-1), (10**-0.5, 1.0)]
    assert [b[:2] for b in bins] == [pytest.approx(e) for e in edges]
    assert [b[2:] for b in bins] == [(2, 0), (1, 0), (2, 1), (1, 0), (1, 1)]
    assert told["bins"][2]["promised"] == pytest.approx(0.025)
    assert (told["bins"][2]["share_low"], told["bins"][2]["share_high"]) == share_interval(1, 2)


def test_nothing_judged_is_told_too():
    assert reliability([]) == {"judged": 0, "expected": 0.0, "met": 0, "bins": []}


# the summary ----------------------------------------------------------------------------------


def result(variant, seed, time=None, contacts=0, cycle=0.01, **others):
    """An episode of 20 s at most."""
    outcome = {
        "reached_goal": time is not None, "time_to_goal": time, "duration": time or 20.0,
        "collisions_moving": contacts, "collisions_moving_beyond_bound": 0,
        "collisions_at_rest": 1, "distance_driven": 10.0, "time_moving": 8.0,
        "broken_premises": 0, "cycles": 4,
    }  # fmt: skip
    return {
        "scenario": "s", "variant": variant, "seed": seed, "error": None, "outcome": outcome,
        "observed": {"cycles": 4, "proven": 3, "cycles_moving": 2, "proven_moving": 1},
        "promised": [0.0, 0.02], "met": [0, contacts],
        "timings": {
            "cycles_us": [9e6, *[1e6 * cycle] * 3],  # the first one compiles
            "seconds": 1.0, "machine": "m", "commit": "c",
        },
    } | others  # fmt: skip


def compared():
    """Nine seeds: b is 2 s sooner where both arrive, but for one seed; it touches somebody once."""
    found = [result("a", seed, 10.0 + seed) for seed in range(8)]
    found += [result("b", k, 8.0 + k, cycle=0.02, contacts=int(k == 3)) for k in range(1, 8)]
    found += [result("a", 8), result("b", 8, 3.0), result("b", 0, error="Traceback", outcome=None)]
    return summarise(["s"], ["a", "b"], {key_of(r): r for r in found})


def test_the_summary_of_a_world_that_can_be_counted_by_hand():
    a, b = compared()["s"].values()
    assert (a["episodes"], a["raised"], a["reached"], a["contact_episodes"]) == (9, 0, 8, 0)
    assert (b["episodes"], b["raised"], b["reached"], b["contact_episodes"]) == (8, 1, 8, 1)
    assert (a["time_q1"], a["time_median"], a["time_q3"]) == (11.75, 13.5, 15.25)
    assert b["contact_share"] == 1 / 8
    assert (b["contact_low"], b["contact_high"]) == share_interval(1, 8)
    assert b["pairs"] == 7  # not seed 0, where b raised, and not seed 8, where a did not arrive
    assert (b["later_median"], b["later_low"], b["later_high"]) == (-2.0, -2.0, -2.0)
    assert a["later_median"] is None
    assert a["mean_speed"] == pytest.approx(90.0 / (sum(range(10, 18)) + 20.0))
    assert (a["p_safe_share"], a["p_safe_share_moving"]) == (0.75, 0.5)
    assert (b["cost_median"], b["cost_ratio"]) == pytest.approx((0.02, 2.0))
    assert b["promises"]["met"] == 1


def test_a_sentence_says_what_it_buys_and_what_it_costs():
    (sentence,) = findings(compared()["s"])
    assert "2.0 s sooner" in sentence
    assert "1 of 8 episodes" in sentence
    assert "2.00 times as long" in sentence


def document():
    return {
        "date": "2026-01-02", "command": "passpmp compare s", "workers": "2 workers",
        "machine": {"machine": "m", "system": "Linux", "python": "3", "taichi": "1", "numpy": "2",
                    "scipy": "1"},
        "machines": ["m"], "commits": ["c"], "episodes_wanted": 18, "episodes_done": 18,
        "variants": ["a", "b"],
        "scenarios": {
            "s": {
                "description": "a <hand-made> world", "duration": 20.0, "object_speed": 2.0,
                "variants": compared()["s"], "findings": findings(compared()["s"]),
            }
        },
    }  # fmt: skip


def test_the_rows_tell_every_number_of_the_summary():
    for group in document()["scenarios"]["s"]["variants"].values():
        told = [key for row in rows.ROWS for key in row.keys]
        assert sorted(told) == sorted(group.keys() - {"promises", "seeds"})
        promises = [key for row in rows.PROMISES for key in row.keys]
        assert sorted(promises) == sorted(group["promises"].keys() - {"bins"})
        for one in group["promises"]["bins"]:
            assert sorted(key for row in rows.BIN for key in row.keys) == sorted(one)
        for one in group["seeds"].values():
            assert sorted(key for row in rows.SEED for key in row.keys) == sorted(one)


def test_the_page_holds_every_number_of_the_summary():
    told = document()
    text = page.html(told, {"s": "film.mp4"})
    for group in told["scenarios"]["s"]["variants"].values():
        cells = [row.told(group) for row in rows.ROWS]
        cells += [row.told(group["promises"]) for row in rows.PROMISES]
        cells += [row.told(b) for b in group["promises"]["bins"] for row in rows.BIN]
        for cell in cells:
            assert f"<td>{escape(cell)}</td>" in text
        for one in group["seeds"].values():
            assert rows.SEED[0].told(one) in text
    origin = ("2026-01-02", "passpmp compare s", "commit c", "Taichi 1", "2 workers", "film.mp4")
    for words in origin:
        assert words in text
    assert "1 episodes ended by an error" in text


def test_the_page_needs_nothing_from_elsewhere_and_escapes_what_it_is_told():
    text = page.html(document(), {})
    for away in ("http://", "https://", "<script", "<link", "@import", "<video"):
        assert away not in text
    assert "&lt;hand-made&gt;" in text
    assert text.count("<svg") == 4


def test_the_table_is_markdown():
    lines = table.markdown(document()).splitlines()
    assert "| | a | b |" in lines
    assert any(line.startswith("| goal reached | 8: 88.9 % (") for line in lines)


def test_a_comparison_that_has_just_begun_has_a_page():
    told = document()
    empty = summarise(["s"], ["a", "b"], {})
    told["scenarios"]["s"] |= {"variants": empty["s"], "findings": findings(empty["s"])}
    assert "0: – (0.0 % to 100.0 %)" in page.html(told, {})
    json.dumps(told, allow_nan=False)


def test_a_legend_of_more_names_than_fit_a_row_stays_in_the_drawing():
    drawing = Drawing((560.0, 340.0), "four")
    legend(drawing, (60.0, 332.0), ["paper kind, 40", "paper kind, 238"] * 2 + ["ours"], 560.0)
    told = re.findall(r'<text class="tick" x="[\d.]+" y="([\d.]+)"', drawing.svg())
    heights = [float(y) for y in told]
    assert len(heights) == 5
    assert max(heights) == 332.0
    assert min(heights) == 317.0
