"""The examples run as they stand, and what they print is what they promise."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def printed(capsys):
    """Run one example as a program; returns what it prints."""

    def run(name):
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
        return capsys.readouterr().out

    return run


def test_every_example_is_tested_here():
    tested = Path(__file__).read_text()
    for example in EXAMPLES.glob("*.py"):
        assert f'printed("{example.stem}")' in tested


def test_one_cycle_plans_a_safe_way_towards_the_goal(printed):
    out = printed("plan_one_cycle")
    nodes, safe, rejected = (int(n) for n in re.findall(r"(\d+) (?:nodes|of them|primitives)", out))
    assert nodes == safe > 100
    assert rejected > 0
    taken, away = (float(v) for v in re.findall(r"(\d+\.\d+) (?:s|m)\b", out))
    assert taken > 0.5
    assert 0.0 <= away < 4.0, "the plan comes nearer to the goal than the start was"


def test_the_loop_drives_to_its_goal_and_touches_nobody(printed):
    out = printed("drive_in_a_loop")
    assert "reached the goal" in out.splitlines()[-1]
    assert float(re.search(r"while moving: (-?\d+\.\d+) m", out)[1]) > 0.0
    places = np.array([float(x) for x in re.findall(r"x +(-?\d+\.\d+) m", out)])
    assert places[0] == 0.0
    assert places.max() > 7.0


def test_the_model_leaves_less_and_less_with_time_and_nearness_to_the_unseen(printed):
    out = printed("ask_the_model")
    answers = [re.findall(r"yes|no", line) for line in out.splitlines() if " m   " in line]
    assert len(answers) == 4
    for row in answers:
        assert row == sorted(row), "what is taken once stays taken"
    # nearer to the open end of the corridor it happens earlier
    first = [row.index("yes") for row in answers]
    assert first == sorted(first, reverse=True)
    speeds = [float(v) for v in re.findall(r"(\d+\.\d+) m/s", out)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] > speeds[-1] > 0.0
    shares = [int(v) for v in re.findall(r"(\d+)%", out)]
    assert shares == sorted(shares, reverse=True)
    assert shares[0] > 50
