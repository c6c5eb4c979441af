"""What this machine has: packages, processors, priorities, sockets. Nothing here takes long."""

from __future__ import annotations

import importlib.util
import os
import platform
import socket
import tempfile
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from hardware import ros1
from hardware.doctor_finding import FAIL, OK, WARN, Finding
from hardware.letterbox import Letterbox
from passpmp_ti import kernel_cache, probe

EXTRAS = {
    "twin": (("mujoco",), "pip install 'passpmp_ti[twin]' for drive --twin"),
    "bags": (("rosbags",), "pip install 'passpmp_ti[bags]' for recordings of ROS"),
    "ros": (
        ("rospy", "sensor_msgs", "tf2_msgs"),
        f"for ROS 1; on Debian: apt-get install --no-install-recommends {ros1.NEEDED}",
    ),
    "ros2": (("cyclonedds",), "pip install 'passpmp_ti[ros2]' for the topics of ROS 2"),
    "cluster": (("dask", "distributed"), "pip install 'passpmp_ti[cluster]' for compare on many"),
    "bench": (("numba",), "pip install 'passpmp_ti[bench]' to compare kernels with Numba"),
}
"""(modules, how they are had and what for) by the name of an extra."""
GOVERNORS = "/sys/devices/system/cpu"
PRIORITY = 10
"""Of SCHED_FIFO that the executor asks for."""


def machine() -> Iterator[Finding]:
    """All of it, one by one."""
    yield Finding(
        "program", OK,
        f"Python {platform.python_version()}, Taichi {metadata.version('taichi')},"
        f" {platform.system()} {platform.machine()}",
    )  # fmt: skip
    yield processors()
    yield governor(Path(GOVERNORS))
    yield priority()
    yield sleeping()
    yield loopback()
    yield gpu()
    yield cache()
    for name in EXTRAS:
        yield extra(name)


def extra(name: str) -> Finding:
    """Whether what an optional part needs is installed."""
    modules, remedy = EXTRAS[name]
    # Debian's folder, where no environment looks, is looked in by the nodes of ROS 1 alone
    there = ros1.there if name == "ros" else importlib.util.find_spec
    missing = [module for module in modules if not there(module)]
    if missing:
        return Finding(f"extra {name}", WARN, f"{', '.join(missing)} not installed", remedy)
    return Finding(f"extra {name}", OK, "installed")


def processors() -> Finding:
    """How many this process may use."""
    can = getattr(os, "sched_getaffinity", None)
    count = len(can(0)) if can else os.cpu_count() or 1
    if count < 2:
        return Finding(
            "processors", WARN, f"{count} for this process",
            "planner and executor share it: plan with a cycle of 0.4 s, and priorities",
        )  # fmt: skip
    return Finding("processors", OK, f"{count} for this process")


def governor(folder: Path) -> Finding:
    """How the processors choose their pace."""
    found = set()
    for file in sorted(folder.glob("cpu[0-9]*/cpufreq/scaling_governor")):
        try:
            found.add(file.read_text().strip())
        except OSError:
            continue
    if not found:
        return Finding("governor", OK, "the system does not tell: it has none, or keeps it")
    if found == {"performance"}:
        return Finding("governor", OK, "performance")
    return Finding(
        "governor", WARN, ", ".join(sorted(found)),
        "processors that rest between cycles are slow when one begins: cpupower frequency-set -g"
        " performance",
    )  # fmt: skip


def priority() -> Finding:
    """Whether this user may go before others."""
    try:
        before, param = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except (OSError, AttributeError) as cause:
        return Finding(
            "SCHED_FIFO", WARN, f"not granted ({cause})",
            "on a busy machine the executor is late and the robot stops each time: add the line"
            " `USER - rtprio 20` to /etc/security/limits.conf and log in again",
        )  # fmt: skip
    os.sched_setscheduler(0, before, param)
    return Finding("SCHED_FIFO", OK, f"granted at {PRIORITY}")


def sleeping() -> Finding:
    """Whether sleep of the machine can be noticed."""
    if hasattr(time, "CLOCK_BOOTTIME"):
        return Finding("sleep", OK, "would be noticed: the robot stops when the machine wakes")
    return Finding(
        "sleep", WARN, "cannot be noticed here", "switch off that this machine goes to sleep"
    )


def loopback() -> Finding:
    """Whether both kinds of sockets work on this machine."""
    try:
        with (
            socket.create_server(("127.0.0.1", 0)) as server,
            socket.create_connection(server.getsockname()[:2], timeout=2.0),
            tempfile.TemporaryDirectory(prefix="passpmp-") as folder,
        ):
            one, other = Letterbox(Path(folder) / "a"), Letterbox(Path(folder) / "b")
            arrived = one.post(other.address, b"x") and bool(other.collect())
            one.close()
            other.close()
    except (OSError, ValueError) as cause:
        return Finding("sockets", FAIL, str(cause), "see what keeps this user from 127.0.0.1")
    if not arrived:
        return Finding("sockets", FAIL, "what is sent does not arrive", "look at the system's log")
    return Finding("sockets", OK, "loopback and datagrams work")


def gpu() -> Finding:
    """Whether kernels can run on one."""
    if not probe.has_driver("cuda"):
        return Finding("GPU", OK, "no driver for CUDA: kernels run on the processors")
    trouble = probe.trouble("cuda", again=True)
    if trouble:
        return Finding(
            "GPU", WARN, f"there is a driver, and it does not work: {trouble}",
            "kernels run on the processors; mend the driver, or take CUDA_VISIBLE_DEVICES away",
        )  # fmt: skip
    return Finding("GPU", OK, "CUDA works")


def cache() -> Finding:
    """Whether compiled kernels are kept."""
    kept = kernel_cache.prepared()
    if kept is None:
        return Finding(
            "kernel cache", WARN, f"{kernel_cache.folder()} cannot be written",
            "every start compiles for long; let XDG_CACHE_HOME name a folder that can be written",
        )  # fmt: skip
    count = sum(1 for _ in kept.glob("*.tic"))
    if not count:
        return Finding(
            "kernel cache", WARN, f"{kept} is empty",
            "the first start compiles for half a minute; start once before you need it",
        )  # fmt: skip
    return Finding("kernel cache", OK, f"{count} kernels in {kept}")
