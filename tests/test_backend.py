"""Which backend runs, found out without risk; and where its compiled kernels are kept."""

import json
import logging
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from passpmp_ti import backend, cli, kernel_cache, probe
from passpmp_ti.bench import startup
from passpmp_ti.bench.fresh import PARTS

HOME = Path(backend.__file__).resolve().parents[1]


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache folder."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "passpmp_ti"


def probing(monkeypatch, program):
    """Have probes run `program`; returns the list of what was probed."""
    asked = []

    def command(name):
        asked.append(name)
        return [sys.executable, "-c", program]

    monkeypatch.setattr(probe, "command", command)
    return asked


def python(program, **environment):
    """A process of its own, which must end well; what it printed."""
    path = os.pathsep.join(p for p in (str(HOME), os.environ.get("PYTHONPATH")) if p)
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": path, **environment},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


# probes -----------------------------------------------------------------------------------------

GOOD = f"print({probe.WORKS!r})"
BAD = {
    "crashes": ("import os; os.abort()", "ends the process"),
    "hangs": ("import time; time.sleep(60)", "did not answer within"),
    "answers wrongly": ("print('42')", "does not compute"),
    "refuses": ("raise RuntimeError('no such device')", "RuntimeError: no such device"),
    "refuses without a word": ("raise SystemExit(3)", "ended with 3"),
}


def test_a_backend_that_answers_rightly_works(cache, monkeypatch):
    probing(monkeypatch, GOOD)
    assert probe.trouble("cuda") == ""


@pytest.mark.parametrize("how", BAD)
def test_a_backend_that_does_not_work_only_ends_its_own_process(how, cache, monkeypatch):
    program, told = BAD[how]
    probing(monkeypatch, program)
    monkeypatch.setattr(probe, "LIMIT", 60.0 if how != "hangs" else 0.5)
    assert told in probe.trouble("cuda")


@pytest.mark.parametrize("folder", [None, os.devnull])
def test_a_real_probe_of_the_cpu_finds_that_it_works(folder, cache, monkeypatch):
    if folder is not None:
        monkeypatch.setenv("XDG_CACHE_HOME", folder)
    assert probe._ask(probe.command("cpu")) == ""


def test_a_verdict_is_remembered_for_this_driver(cache, monkeypatch):
    asked = probing(monkeypatch, GOOD)
    for _ in range(3):
        assert probe.trouble("cuda") == ""
    assert asked == ["cuda"]
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "1")
    assert probe.trouble("cuda") == ""
    assert asked == ["cuda", "cuda"]
    assert probe.trouble("vulkan") == ""
    assert asked == ["cuda", "cuda", "vulkan"]


def test_what_did_not_work_is_tried_again_when_asked_for_or_when_it_is_long_ago(cache, monkeypatch):
    asked = probing(monkeypatch, "raise SystemExit(3)")
    assert probe.trouble("cuda")
    assert probe.trouble("cuda")
    assert len(asked) == 1
    assert probe.trouble("cuda", again=True)
    assert len(asked) == 2
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 2 * probe.FORGET)
    asked = probing(monkeypatch, GOOD)
    assert probe.trouble("cuda") == ""
    assert len(asked) == 1


@pytest.mark.parametrize("written", ["", "[1, 2]", '{"cuda": 7', '{"vulkan": {}}'])
def test_notes_that_cannot_be_read_are_made_anew(written, cache, monkeypatch):
    cache.mkdir()
    (cache / "backends.json").write_text(written)
    probing(monkeypatch, GOOD)
    assert probe.trouble("cuda") == ""
    assert json.loads((cache / "backends.json").read_text())["cuda"]["trouble"] == ""


def test_a_verdict_that_cannot_be_kept_is_none_the_worse(monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", os.devnull)
    probing(monkeypatch, GOOD)
    assert probe.trouble("cuda") == ""


# the choice -------------------------------------------------------------------------------------


def test_auto_probes_nothing_where_no_driver_is(monkeypatch):
    monkeypatch.setattr(probe, "has_driver", lambda name: False)
    monkeypatch.setattr(probe, "trouble", None)
    assert backend._chosen() == "cpu"


def test_auto_takes_cuda_where_it_works(monkeypatch):
    monkeypatch.setattr(probe, "has_driver", lambda name: True)
    monkeypatch.setattr(probe, "trouble", lambda name: "")
    assert backend._chosen() == "cuda"


def test_auto_takes_the_cpu_where_cuda_does_not_work_and_says_so(monkeypatch, caplog):
    monkeypatch.setattr(probe, "has_driver", lambda name: True)
    monkeypatch.setattr(probe, "trouble", lambda name: "its driver is asleep")
    with caplog.at_level(logging.WARNING, "passpmp_ti"):
        assert backend._chosen() == "cpu"
    assert "its driver is asleep" in caplog.text


@pytest.mark.parametrize("name", ["cuda", "vulkan", "metal"])
def test_a_backend_asked_for_by_name_that_does_not_work_is_refused_with_the_way_out(
    name, monkeypatch
):
    monkeypatch.setattr(backend, "_running", None)
    monkeypatch.setattr(probe, "trouble", lambda _, again: "its driver is asleep")
    with pytest.raises(RuntimeError, match=r"its driver is asleep.*use 'auto' or 'cpu'"):
        backend.init(name)
    assert backend.running() is None


def test_a_benchmark_is_refused_on_a_backend_that_does_not_work(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(backend, "_running", None)
    monkeypatch.setattr(probe, "trouble", lambda name, again: asked.append(name) or "it is asleep")
    assert cli.main(["bench", "check", "--quick", "--backend", "cuda"]) == cli.BAD_INPUT
    assert asked == ["cuda"]
    assert "it is asleep" in capsys.readouterr().err


def test_a_fresh_process_says_what_it_picked(tmp_path):
    told = python(
        "import logging, passpmp_ti; logging.basicConfig(level=logging.INFO);"
        "print('picked', passpmp_ti.init())",
        XDG_CACHE_HOME=str(tmp_path),
    )
    picked = next(line for line in told.splitlines() if line.startswith("picked ")).split()[1]
    assert picked in backend.BACKENDS
    assert f"kernels run on {picked}" in told


# the kernel cache -------------------------------------------------------------------------------


def test_the_cache_lies_in_the_user_s_cache_folder(cache, monkeypatch):
    assert kernel_cache.folder() == cache / "kernels"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert kernel_cache.folder() == Path.home() / ".cache" / "passpmp_ti" / "kernels"


def test_a_folder_that_cannot_be_written_is_told_of_once_and_done_without(monkeypatch, caplog):
    monkeypatch.setenv("XDG_CACHE_HOME", os.devnull)
    with caplog.at_level(logging.WARNING, "passpmp_ti"):
        assert kernel_cache.prepared() is None
    assert len(caplog.records) == 1
    assert "XDG_CACHE_HOME" in caplog.text


def test_a_process_without_a_cache_folder_computes_all_the_same():
    told = python(
        "import numpy as np, passpmp_ti; passpmp_ti.init('cpu');"
        "from passpmp_ti.kernels.probe import add_up;"
        "total = np.zeros(2, np.float32);"
        "add_up(np.ones(2, np.int32), np.ones(2, np.float32), total); print(total)",
        XDG_CACHE_HOME=os.devnull,
    )
    assert "[1.5 1.5]" in told


def test_what_a_killed_process_left_behind_is_removed_and_nothing_else(cache):
    kept = kernel_cache.prepared()
    old = time.time() - 2 * kernel_cache.STALE
    files = {
        "ticache.lock": b"", "begun.tic": b"", "whole.tic": b"kernel", "ticache.tcb": b"list",
    }  # fmt: skip
    for name, content in files.items():
        (kept / name).write_bytes(content)
        os.utime(kept / name, (old, old))
    (kept / "beginning.tic").write_bytes(b"")
    kernel_cache.prepared()
    assert sorted(f.name for f in kept.iterdir()) == ["beginning.tic", "ticache.tcb", "whole.tic"]


def test_a_lock_that_is_held_is_left_alone(cache):
    kept = kernel_cache.prepared()
    (kept / kernel_cache.LOCK).touch()
    kernel_cache.prepared()
    assert (kept / kernel_cache.LOCK).exists()


ONE_KERNEL = (
    "import numpy as np, passpmp_ti; passpmp_ti.init('cpu');"
    "from passpmp_ti.kernels.probe import add_up;"
    "total = np.zeros(2, np.float32);"
    "add_up(np.ones(2, np.int32), np.ones(2, np.float32), total); assert total[0] == 1.5"
)


def test_processes_that_start_together_leave_a_cache_that_the_next_one_reads(cache, tmp_path):
    path = os.pathsep.join(p for p in (str(HOME), os.environ.get("PYTHONPATH")) if p)
    together = [
        subprocess.Popen([sys.executable, "-c", ONE_KERNEL], env={**os.environ, "PYTHONPATH": path})
        for _ in range(3)
    ]
    assert [process.wait(300) for process in together] == [0, 0, 0]
    kept = {f.name: f.read_bytes() for f in (cache / "kernels").iterdir()}
    assert sum(name.endswith(".tic") for name in kept) == 1
    assert kernel_cache.LOCK not in kept
    python(ONE_KERNEL)
    after = {f.name: f.read_bytes() for f in (cache / "kernels").glob("*.tic")}
    assert after == {name: kept[name] for name in after}


# imports ----------------------------------------------------------------------------------------


def test_importing_the_package_imports_nothing_that_takes_long():
    told = python(
        "import sys, passpmp_ti, passpmp_ti.settings, passpmp_ti.robots;"
        "print([m for m in ('taichi', 'cv2', 'scipy') if m in sys.modules])"
    )
    assert told.strip() == "[]"


def test_importing_the_planner_does_not_import_scipy():
    told = python(
        "import sys, passpmp_ti.planner.navigator;"
        "print([m for m in ('scipy',) if m in sys.modules])"
    )
    assert told.strip().endswith("[]")


def test_what_taichi_says_of_a_mistake_still_shows_the_line():
    import taichi as ti

    @ti.kernel
    def mistaken() -> ti.i32:
        return no_such_name + 1000000 + 2000000 + 3000000 + 4000000 + 5000000 + 6000000  # noqa: F821

    with pytest.raises(ti.TaichiNameError) as error:
        mistaken()
    line = next(row for row in str(error.value).splitlines() if "no_such_name + " in row)
    assert "6000000" in line
    assert "^^^^^^" in str(error.value)


# the benchmark ----------------------------------------------------------------------------------


def test_a_fresh_process_tells_what_its_start_took(tmp_path, monkeypatch):
    # how long does not matter here: kernels that are not optimised compile in a quarter of the time
    monkeypatch.setenv("TI_ADVANCED_OPTIMIZATION", "0")
    seconds = startup.fresh(str(tmp_path), "cpu")
    assert tuple(seconds) == PARTS
    assert all(value >= 0 for value in seconds.values())
    assert list((tmp_path / "passpmp_ti" / "kernels").glob("*.tic"))


@pytest.mark.skipif(
    not hasattr(os, "sched_getaffinity") or len(os.sched_getaffinity(0)) < 2,
    reason="the kernels' threads have cores of their own only where Linux has several to give",
)
def test_the_threads_that_work_have_a_core_each():
    """In a process of its own: threads are given their cores as Taichi starts."""
    told = """
import os
import numpy as np
import passpmp_ti as pti
from passpmp_ti.kernels.probe import add_up

def spent(thread):
    try:
        return int(open(f"/proc/self/task/{thread}/schedstat").read().split()[0])
    except FileNotFoundError:
        return 0  # it has ended since, and worked for nobody

pti.init("cpu")
whole, real = np.zeros(4_000_000, dtype=np.int32), np.zeros(4_000_000, dtype=np.float32)
add_up(whole, real, real)
threads = [int(t) for t in os.listdir("/proc/self/task")]
before = {t: spent(t) for t in threads}
for _ in range(20):
    add_up(whole, real, real)
busy = sorted(threads, key=lambda t: before[t] - spent(t))[: len(os.sched_getaffinity(0))]
print(sorted(core for t in busy for core in os.sched_getaffinity(t)))
print(sorted(os.sched_getaffinity(0)))
"""
    answer = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True)
    assert answer.returncode == 0, answer.stderr
    worked, all_cores = answer.stdout.splitlines()
    assert worked == all_cores
