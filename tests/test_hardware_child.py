"""Processes that are started: what they complain of holds nobody up."""

import os
import sys
import textwrap

import pytest

from hardware.child import ended, started

TALKER = """
    import sys
    print("ready", flush=True)
    sys.stderr.write("x" * 300_000)
    print("done", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def talker(tmp_path, monkeypatch):
    (tmp_path / "talker.py").write_text(textwrap.dedent(TALKER))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    return "talker"


def test_a_child_that_complains_a_lot_goes_on(talker):
    process, line = started(talker, "", 30.0)
    assert line == b"ready\n"
    # a pipe holds 64 KiB: with one it would not get here before somebody reads
    assert process.stdout.readline() == b"done\n"
    assert len(process.complaints()) == 300_000
    assert len(ended(process, 10.0)) == 300_000


def test_a_child_that_does_not_start_tells_why(tmp_path, monkeypatch):
    (tmp_path / "broken.py").write_text("raise ValueError('no such chair')\n")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), *sys.path]))
    with pytest.raises(RuntimeError, match=r"broken did not start(.|\n)*no such chair"):
        started("broken", "", 30.0)
