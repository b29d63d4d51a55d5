"""Format `insole-cobs`: every byte of it, from the description alone."""

import pytest

from drivers.insole.formats.insole_cobs import InsoleCobsParser
from drivers.insole.frame import InsoleFrame
from tests.unit.insole.encode import (
    CALIBRATED,
    MISSING,
    RIGHT,
    SATURATED,
    cobs,
    cobs_frame,
    crc16_ccitt_false,
)
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [cobs_frame([n + cell for cell in range(16)], sequence=n, time_us=5000 * n) for n in range(60)]


def test_crc_of_the_check_string() -> None:
    assert crc16_ccitt_false(b"123456789") == 0x29B1


def test_frame_written_out_by_hand() -> None:
    body = bytes.fromhex("31 02 0201 40420f00 02 0c 6400 0000")
    crc = crc16_ccitt_false(body).to_bytes(2, "little")
    assert 0 not in crc
    # Blocks end where a zero was: 31 02 02 01 40 42 0F | 02 0C 64 | (nothing) | (nothing) | the CRC.
    wire = b"\x08" + body[:7] + b"\x04" + body[8:11] + b"\x01\x01\x03" + crc + b"\0"
    assert parse(InsoleCobsParser, wire) == [
        InsoleFrame(
            cells=(10_000.0, 0.0), foot="left", calibrated=True, bits=12, sequence=258, ticks=1_000_000
        )
    ]
    assert wire == cobs_frame([100, 0], sequence=258, time_us=1_000_000)


def test_counts_stay_counts_when_not_calibrated() -> None:
    (frame,) = parse(InsoleCobsParser, cobs_frame([0, 4095], flags=RIGHT))
    assert (frame.foot, frame.calibrated, frame.cells, frame.bits) == ("right", False, (0.0, 4095.0), 12)


def test_flags_are_reported_and_a_missing_cell_is_none_not_a_number() -> None:
    parser = InsoleCobsParser()
    (frame,) = parser.feed(cobs_frame([0xFFFF, 7], flags=CALIBRATED | SATURATED | MISSING))
    assert frame.cells == (None, 700.0)
    assert frame.saturated
    assert frame.missing
    assert parser.counters.saturated == 1


def test_full_scale_is_a_value_when_no_cell_is_missing() -> None:
    (frame,) = parse(InsoleCobsParser, cobs_frame([0xFFFF]))
    assert frame.cells == (6_553_500.0,)


@pytest.mark.parametrize("n", [1, 2, 16, 35, 64])
def test_every_split_point(n: int) -> None:
    frames = [cobs_frame([(cell * 37) % 4096 for cell in range(n)], sequence=s) for s in range(3)]
    stream = b"".join(frames)
    assert_same_at_every_split(InsoleCobsParser, stream, parse(InsoleCobsParser, stream))
    assert len(parse(InsoleCobsParser, stream)) == 3


def test_every_damaged_byte() -> None:
    frames = [cobs_frame([s, 0, 256, 4095], sequence=s, time_us=s * 5000) for s in range(6)]
    assert_damage_is_contained(InsoleCobsParser, frames, damaged=2)


def test_last_frame_counts_without_its_delimiter_at_the_end_of_a_file() -> None:
    assert len(parse(InsoleCobsParser, cobs_frame([1, 2, 3])[:-1])) == 1


def test_stream_entered_in_the_middle_loses_one_frame_and_counts_its_bytes() -> None:
    frames = [cobs_frame([1, 2, 3], sequence=s) for s in range(3)]
    parser = InsoleCobsParser()
    assert [frame.sequence for frame in parser.feed(b"".join(frames)[5:])] == [1, 2]
    assert parser.counters.bytes_dropped == len(frames[0]) - 5 - 1  # its delimiter ends it


@pytest.mark.parametrize(
    ("body", "what"),
    [
        (bytes.fromhex("32 02 0000 00000000 01 0c 0100"), "another version"),
        (bytes.fromhex("31 02 0000 00000000 02 0c 0100"), "fewer cells than said"),
        (bytes.fromhex("31 02 0000 00000000 00 0c 0100"), "no cells"),
        (bytes.fromhex("31 02 0000 00000000 41 0c") + bytes(2 * 64), "more cells than there may be"),
    ],
)
def test_right_checksum_over_impossible_contents_is_malformed(body: bytes, what: str) -> None:
    wire = cobs(body + crc16_ccitt_false(body).to_bytes(2, "little")) + b"\0"
    parser = InsoleCobsParser()
    assert parser.feed(wire) == [], what
    assert (parser.counters.malformed, parser.counters.bad_checksums) == (1, 0)
    assert parser.counters.bytes_dropped == len(wire) - 1


def test_wrong_checksum_is_counted() -> None:
    wire = bytearray(cobs_frame([1, 2, 3]))
    wire[-2] ^= 0x40
    parser = InsoleCobsParser()
    assert parser.feed(bytes(wire)) == []
    assert parser.counters.bad_checksums == 1


def test_gaps_repetitions_and_late_frames_are_told_apart_for_each_foot() -> None:
    parser = InsoleCobsParser()
    order = [(0, 65534), (1, 7), (0, 65535), (1, 8), (0, 0), (0, 3), (0, 1), (1, 8), (0, 4)]
    frames = parser.feed(b"".join(cobs_frame([1], flags=CALIBRATED | foot, sequence=s) for foot, s in order))
    assert [frame.late for frame in frames] == [False] * 6 + [True, True, False]
    counters = parser.counters
    assert (counters.frames, counters.sequence_gaps, counters.frames_missed) == (9, 1, 2)
    assert counters.out_of_order == 2


def test_device_that_counts_anew_is_believed_after_a_run_of_rising_frames() -> None:
    parser = InsoleCobsParser()
    frames = parser.feed(b"".join(cobs_frame([1], sequence=s) for s in (30_000, 30_001, *range(10))))
    assert [frame.late for frame in frames] == [False] * 2 + [True] * 7 + [False] * 3
    assert (parser.counters.out_of_order, parser.counters.sequence_gaps) == (7, 0)


def test_block_of_late_frames_is_no_new_beginning() -> None:
    parser = InsoleCobsParser()
    order = [1, 2, 3, 8, 4, 5, 6, 7, 9]
    frames = parser.feed(b"".join(cobs_frame([1], sequence=s) for s in order))
    assert [frame.sequence for frame in frames if not frame.late] == [1, 2, 3, 8, 9]


def test_endless_noise_without_a_delimiter_is_bounded_and_counted() -> None:
    parser = InsoleCobsParser()
    for _ in range(1000):
        assert parser.feed(b"\xff" * 100) == []
    assert len(parser._buffer) <= parser.longest
    assert [frame.sequence for frame in parser.feed(b"\0" + cobs_frame([1], sequence=9))] == [9]
    assert parser.counters.bytes_dropped == 100_000
