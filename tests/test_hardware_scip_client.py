"""The client and the emulator over real sockets, on loopback only."""

import errno
import itertools
import json
import os
import socket
import subprocess
import sys
import time
from importlib.util import find_spec

import numpy as np
import pytest

from hardware.merge import Pairing, read_together
from hardware.scip_client import ScipClient, wait
from hardware.scip_device import Device
from hardware.scip_emulator import Emulator
from hardware.scip_rotor import Nature
from hardware.scip_settings import ScipSettings

RANGES = np.linspace(0.5, 9.5, 1081)


def emulator(source=lambda _: RANGES, nature=None, **options):
    return Emulator(lambda now: Device(source, now, nature), **options)


def settings(port, **changes):
    return ScipSettings(host="127.0.0.1", port=port, retry_first=0.02, **changes)


def until(condition, client, seconds=5.0):
    """Read until the condition holds; returns the scans."""
    scans, end = [], time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, client.trouble
        scans += [scan for scan in [client.read(0.05)] if scan is not None]
    return scans


def test_scans_come_over_the_network_and_are_stamped_with_this_machines_clock():
    with emulator() as device, ScipClient(settings(device.address[1])) as client:
        before = time.monotonic()
        scan = client.read(5.0)
        assert before < scan.stamp < time.monotonic()
        assert np.allclose(scan.ranges, RANGES, atol=6e-4)
        assert client.streaming
        assert client.session.version["PROD"] == "UST-10LX"
        assert client.session.parameters.farthest == 30000
        assert client.session.state["STAT"] == "sensor is working normally"


def test_who_reads_seldom_gets_the_newest_scan_and_not_the_next_one():
    numbers = itertools.count(1000)
    with (
        emulator(lambda _: np.full(1081, next(numbers))) as device,
        ScipClient(settings(device.address[1])) as client,
    ):
        until(lambda: client.streaming, client)
        # sweeps come while nobody reads
        while client.counters.passed < 3:
            client.step()
            wait([client], 0.05)
        scan = client.read(1.0)
        assert scan.ranges[0] == client.session.sweep.distances[0] / 1000


def test_nothing_listens_anywhere_but_on_loopback_unless_told():
    with emulator() as device:
        assert device.address[0] == "127.0.0.1"


def test_a_client_without_a_device_waits_longer_and_longer_and_raises_nothing():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
    now = [100.0]
    client = ScipClient(settings(port, retry_most=0.3), clock=lambda: now[0])
    attempts, lost = [], 0
    for _ in range(2000):
        client.step()
        if client.counters.lost > lost:
            lost = client.counters.lost
            attempts.append(now[0])
        now[0] += 1e-3
    pauses = np.diff(attempts)
    assert np.allclose(pauses[:5], [0.02, 0.04, 0.08, 0.16, 0.3], atol=3e-3)
    assert np.allclose(pauses[5:], 0.3, atol=3e-3)
    assert client.trouble == f"[Errno {errno.ECONNREFUSED}] {os.strerror(errno.ECONNREFUSED)}"


def test_a_client_comes_back_after_every_loss():
    with emulator() as device, ScipClient(settings(device.address[1])) as client:
        assert client.read(5.0) is not None
        device.hang_up()
        until(lambda: client.counters.connections == 2, client)
        assert client.counters.lost >= 1
        assert client.trouble
        device.inject("drop", 15)
        until(lambda: client.counters.connections == 3, client)


def test_a_device_that_reboots_is_read_again_with_its_new_clock():
    nature = Nature(clock_start=8_000_000, boot_time=0.2)
    with emulator(nature=nature) as device, ScipClient(settings(device.address[1])) as client:
        assert client.read(5.0) is not None
        device.reboot()
        scans = until(lambda: client.counters.connections == 2 and client.streaming, client)
        scans.append(client.read(1.0))
        # over the gap the stamps go on, though the device's own clock began anew
        stamps = [scan.stamp for scan in scans]
        assert stamps == sorted(stamps)
        assert stamps[-1] <= time.monotonic()


def test_a_second_host_is_turned_away_or_takes_over():
    with emulator() as device, ScipClient(settings(device.address[1])) as first:
        assert first.read(5.0) is not None
        with ScipClient(settings(device.address[1])) as second:
            until(lambda: second.counters.lost >= 2, second)
            assert second.counters.scans == 0
            assert first.read(1.0) is not None
    with emulator(second="steal") as device, ScipClient(settings(device.address[1])) as first:
        assert first.read(5.0) is not None
        with ScipClient(settings(device.address[1])) as second:
            assert second.read(5.0) is not None
            first.step()
            until(lambda: first.counters.lost >= 1, first)


def test_a_device_that_cannot_do_what_is_asked_is_the_users_to_mend():
    with (
        emulator() as device,
        ScipClient(settings(device.address[1], range_max=60.0)) as client,
        pytest.raises(ValueError, match="range_max must be at most"),
    ):
        client.read(5.0)


def test_a_source_that_fails_is_told_when_the_emulator_is_closed():
    device = emulator(lambda _: np.zeros(3))
    with ScipClient(settings(device.address[1])) as client:
        until(lambda: client.counters.lost >= 1, client)
    with pytest.raises(RuntimeError, match="must return 1081 values"):
        device.close()


def test_a_host_that_does_not_read_costs_the_device_no_memory():
    with (
        emulator(second="steal") as device,
        socket.create_connection(device.address, timeout=5) as host,
    ):
        host.settimeout(0.2)
        # the answers would be forty times as long as the questions
        with pytest.raises(TimeoutError):
            host.sendall(b"VV\n" * 10_000_000)
        with ScipClient(settings(device.address[1])) as client:
            assert client.read(5.0) is not None


def test_two_range_finders_are_read_as_scans_of_one_instant():
    with (
        emulator() as front,
        emulator() as rear,
        ScipClient(settings(front.address[1])) as one,
        ScipClient(settings(rear.address[1])) as two,
    ):
        pairing = Pairing(2, apart=0.0135)
        pairs = [read_together([one, two], pairing, 5.0) for _ in range(20)]
        assert all(a.stamp == b.stamp for a, b in pairs)
        steps = np.diff([a.stamp for a, _ in pairs])
        assert (steps > 0).all()
        wait([one, two], 0.0)


@pytest.mark.skipif(
    find_spec("hokuyolx") is None, reason="hokuyolx is not installed: pip install hokuyolx"
)
def test_a_client_that_somebody_else_wrote_reads_the_emulator():
    # it spins for ever where a device hangs up, so it runs in a process with a time-out
    code = """if True:
        import json, sys
        from hokuyolx import HokuyoLX
        laser = HokuyoLX(addr=("127.0.0.1", int(sys.argv[1])), timeout=5)
        told = {"state": laser.laser_state()[0], "model": laser.model, "front": laser.aforw}
        told["version"] = laser.version()["PROT"]
        told["health"] = laser.sensor_state()["STAT"]
        stamp, told["one"] = laser.get_dist()
        told["strong"] = laser.get_intens(start=10, end=19)[1]
        stream = [(scan, when, left) for scan, when, left in laser.iter_dist(20)]
        told["stream"] = [scan for scan, _, _ in stream]
        told["left"] = [left for _, _, left in stream]
        told["steps"] = [b[1] - a[1] for a, b in zip(stream, stream[1:])]
        told["echoes"] = [s for s, _, _ in laser.iter_intens(3, grouping=2, skips=1)][-1]
        laser.close()
        print(json.dumps(told, default=lambda x: x.tolist()))
    """
    told = np.rint(RANGES * 1000).astype(int)
    with emulator() as device:
        done = subprocess.run(
            [sys.executable, "-c", code, str(device.address[1])],
            capture_output=True, text=True, timeout=30, check=True,
        )  # fmt: skip
    seen = json.loads(done.stdout)
    assert (seen["state"], seen["model"], seen["front"]) == (3, "UST-10LX", 540)
    assert (seen["version"], seen["health"]) == ("SCIP 2.2", "sensor is working normally")
    assert seen["one"] == told.tolist()
    assert seen["strong"] == [[mm, 1000] for mm in told[10:20]]
    assert seen["stream"] == [told.tolist()] * 20
    assert seen["left"] == list(range(19, -1, -1))
    # whole turns of 25 ms, several where this machine had no time for one
    assert all(abs(step - 25 * max(1, round(step / 25))) <= 1 for step in seen["steps"])
    assert [mm for mm, _ in seen["echoes"]] == [min(told[i : i + 2]) for i in range(0, 1081, 2)]
