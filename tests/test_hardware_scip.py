"""SCIP 2 bytes: what the manual prints, there and back, and what is refused."""

import random
import subprocess
import sys

import numpy as np
import pytest

from hardware import fuzz, scip
from hardware.scip_commands import Measure, Plain, decode_command
from hardware.scip_sweep import (
    AT_THE_SENSOR,
    UST_10LX,
    UST_CODES,
    UTM_CODES,
    Parameters,
    Sweep,
    decode_sweep,
    distances_of,
    encode_sweep,
    ranges_of,
)


@pytest.mark.parametrize(
    ("number", "text"), [(1234, b"CB"), (5432, b"1Dh"), (16_000_000, b"m2@0")]
)
def test_numbers_are_written_as_the_manual_prints_them(number, text):
    assert scip.encode_numbers(np.array([number]), len(text)) == text
    assert scip.decode_numbers(text, len(text)).tolist() == [number]


@pytest.mark.parametrize(("line", "total"), [(b"00", b"P"), (b"99", b"b"), (b"02", b"R")])
def test_check_sums_are_those_of_the_manual(line, total):
    assert scip.summed(line) == line + total
    assert scip.checked(line + total) == line


def test_a_reply_is_echo_status_lines_and_an_empty_line():
    reply = scip.Reply(b"TM1;hi", "00", (scip.summed(b"m2@0"),))
    told = scip.encode_reply(reply)
    assert told.split(b"\n") == [b"TM1;hi", b"00P", scip.summed(b"m2@0"), b"", b""]
    assert scip.decode_reply(told[:-2]) == reply


def test_a_whole_sweep_of_a_ust_is_as_many_bytes_as_it_is_known_to_be():
    sweep = Sweep(1, np.full(1081, 5000), np.full(1081, 700))
    assert len(scip.encode_reply(encode_sweep(Measure("MD", 0, 1080), sweep))) == 3372
    assert len(scip.encode_reply(encode_sweep(Measure("ME", 0, 1080), sweep))) == 6717


@pytest.mark.parametrize("kind", ["GD", "GE", "GS", "MD", "ME", "MS"])
@pytest.mark.parametrize(("start", "end", "cluster"), [(0, 1080, 1), (3, 23, 7), (10, 20, 4)])
def test_a_sweep_comes_back_as_it_was_sent(kind, start, end, cluster):
    generator = np.random.default_rng(0)
    command = Measure(kind, start, end, cluster)
    most = 4096 if kind[1] == "S" else 1 << 18
    sent = Sweep(0xFFFFFF, *generator.integers(0, most, (2, command.groups)))
    reply = scip.decode_reply(scip.encode_reply(encode_sweep(command, sent))[:-2])
    came = decode_sweep(command, reply)
    assert came.stamp == sent.stamp
    assert np.array_equal(came.distances, sent.distances)
    assert (came.intensities is None) == (kind[1] != "E")
    if came.intensities is not None:
        assert np.array_equal(came.intensities, sent.intensities)


def is_sweep(command, frame):
    """Whether a host would take this for a sweep."""
    try:
        reply = scip.decode_reply(frame)
        decode_sweep(command, reply)
    except scip.Garbled:
        return False
    return reply.status == "99"


def test_every_changed_byte_of_a_sweep_is_noticed():
    command = Measure("MD", 0, 60)
    told = scip.encode_reply(encode_sweep(command, Sweep(77, np.arange(20, 81) * 100)))[:-2]
    assert is_sweep(command, told)
    count = range(13, 15)  # of sweeps still to come, in the echo, which has no check sum
    for at in sorted(set(range(len(told))) - set(count)):
        for bit in range(7):
            changed = told[:at] + bytes([told[at] ^ 1 << bit]) + told[at + 1 :]
            # bit 6 is not in the sum, but it leads out of the characters that a number has
            assert not is_sweep(command, changed)


def test_a_missing_line_of_a_sweep_is_noticed():
    command = Measure("MD", 0, 1080)
    reply = encode_sweep(command, Sweep(77, np.arange(1081)))
    for i in range(len(reply.lines)):
        short = scip.Reply(reply.echo, reply.status, reply.lines[:i] + reply.lines[i + 1 :])
        with pytest.raises(scip.Garbled):
            decode_sweep(command, short)


def test_information_may_have_either_check_sum():
    info = UST_10LX.to_info()
    lines = scip.encode_info(info)
    assert scip.decode_info(lines) == info
    other = tuple(scip.summed(line[:-1]) for line in lines)
    assert other != lines
    assert scip.decode_info(other) == info
    assert Parameters.from_info(info) == UST_10LX
    with pytest.raises(scip.BadSum):
        scip.decode_info((b"DMIN:20;0",))


@pytest.mark.parametrize(
    ("key", "text"),
    [("DMIN", "0"), ("AMAX", "20000"), ("SCAN", "0"), ("ARES", ""), ("AFRT", "-1"), ("DMAX", "x")],
)
def test_parameters_that_belong_to_no_range_finder_are_not_believed(key, text):
    with pytest.raises(scip.Garbled, match="PP"):
        Parameters.from_info(UST_10LX.to_info() | {key: text})


@pytest.mark.parametrize(
    "command",
    [
        Plain("VV"), Plain("%ST"), Plain("TM", "1"), Plain("SS", "019200"),
        Plain("BM", text="0123456789abcdef"), Measure("GD", 0, 1080, 4),
        Measure("ME", 44, 725, 1, 3, 99, "x"),
    ],
)  # fmt: skip
def test_a_command_comes_back_as_it_was_sent(command):
    assert decode_command(command.encode()) == command


@pytest.mark.parametrize(
    ("line", "status"),
    [
        (b"XX", "0E"), (b"\xff\xfe", "0E"), (b"", "0E"), (b"MD0000", "0H"), (b"TM", "0H"),
        (b"VV1", "0D"), (b"MD00001080010000", "0D"), (b"VV;0123456789abcdefg", "0G"),
        (b"x" * 100, "0D"), (b"MDx000108001000", "01"), (b"MD0000x08001000", "02"),
        (b"MD00001080x1000", "03"), (b"MD0000108001x00", "06"), (b"MD00001080010x0", "07"),
        (b"GD00001080 1", "03"), (b"HD0000108001", "0F"),
    ],
)  # fmt: skip
def test_what_is_no_command_has_the_status_that_says_why(line, status):
    with pytest.raises(scip.Refused) as refusal:
        decode_command(line)
    assert refusal.value.status == status


def test_a_stream_is_cut_where_it_ends_however_it_comes_and_keeps_little():
    for size in (1, 2, 3, 7):
        splitter = scip.Splitter(b"\n\n", 10)
        stream = b"one\n\n\n\nt\nwo\n\nthr"
        pieces = [stream[i : i + size] for i in range(0, len(stream), size)]
        assert [x for piece in pieces for x in splitter.feed(piece)] == [b"one", b"t\nwo"]
    assert splitter.overflows == 0
    assert splitter.feed(b"x" * 1000) == []
    assert splitter.overflows == 1
    assert splitter.feed(b"\n\nnext\n\n")[-1] == b"next"


def test_ranges_mean_what_rep_117_says_and_lean_to_the_unsafe_side():
    told = np.array([5000, 20, 9999, 10000, 29000, 65533, 65534, 65535, 2, 4, 0, 1, 7, 19])
    meant = [5.0, 0.02, 9.999, *[np.inf] * 3, np.nan, np.nan, *[AT_THE_SENSOR] * 2, *[np.nan] * 4]
    assert np.array_equal(ranges_of(told, UST_10LX, UST_CODES, 10.0), meant, equal_nan=True)
    # what is too near to be measured vouches for no space before the device's least distance
    assert UST_10LX.nearest > AT_THE_SENSOR * 1000


def test_codes_differ_between_families():
    told = np.array([1, 2, 3, 65533])
    meant = [np.inf, AT_THE_SENSOR, np.nan, np.nan]
    assert np.array_equal(ranges_of(told, UST_10LX, UTM_CODES, 10.0), meant, equal_nan=True)


def test_ranges_are_told_and_read_back_to_the_millimetre():
    ranges = np.array([0.5, 1.2345, 9.9994, np.inf, np.nan, 0.004, 0.0, 40.0])
    told = distances_of(ranges, UST_10LX, UST_CODES)
    back = ranges_of(told, UST_10LX, UST_CODES, 10.0)
    meant = [0.5, 1.234, 9.999, np.inf, np.nan, AT_THE_SENSOR, np.nan, np.inf]
    assert np.allclose(back, meant, atol=1e-9, equal_nan=True)


def test_reading_a_range_finder_needs_no_taichi():
    # a process that only reads it stays small
    code = (
        "import sys, hardware.scip_client, hardware.scip_emulator, hardware.merge;"
        "sys.exit('taichi' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_broken_input_is_refused_by_the_protocol_and_by_nothing_else():
    shares = {"reply": 0.4, "command": 0.4, "device": 0.1, "session": 0.1}
    findings = fuzz.fuzz(4000, random.Random(1), shares)
    assert findings.failures == []
    assert findings.refused > 1000


def test_the_fuzzer_notices_what_does_not_belong_to_the_protocol(monkeypatch):
    def forgetful(frame):
        echo, status, *lines = frame.split(b"\n")
        return scip.Reply(echo, status.decode(), tuple(lines))

    monkeypatch.setattr(fuzz, "decode_reply", forgetful)
    assert fuzz.fuzz(500, random.Random(1), {"reply": 1.0}).failures


@pytest.mark.campaign
def test_a_million_broken_inputs():
    findings = fuzz.fuzz(1_000_000, random.Random(0))
    assert findings.failures == []
