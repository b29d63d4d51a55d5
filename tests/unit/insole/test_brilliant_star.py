"""Format `brilliant-star`, as its boards' firmware logs: inverted, lines out of order, a foot missing."""

import pytest

from drivers.cli.live import table
from drivers.identify import recognise
from drivers.insole.build import insoles
from drivers.insole.formats.brilliant_star import FORMAT, HEADER, LAYOUT, BrilliantStarParser
from drivers.insole.frame import InsoleFrame
from drivers.insole.layout import load
from drivers.insole.settings import InsoleSettings
from drivers.parsing import Counters
from hil_sim.sensors.insoles import brilliant_star as simulated
from tests.unit.port.streams import assert_same_at_every_split, parse

BANNER = b"[SD] init OK.\r\n[FW] v3.1.0\r\n# fw=v3.1.0\n" + HEADER + b"\r\n"
UNLOADED = [4095] * 16
GONE = [0] * 16
SERIAL = "/dev/serial/by-id/usb-board"


def line(frame_id: int, right: list[int], left: list[int], flags: int = 0) -> bytes:
    return ",".join(map(str, [50 * frame_id, frame_id, *right, *left, flags])).encode("ascii") + b"\r\n"


STREAM = [line(n, [4095 - n] * 16, [4000 - n] * 16) for n in range(1, 40)]


def fed(*lines: bytes) -> tuple[list[InsoleFrame], Counters]:
    parser = BrilliantStarParser()
    return [frame for one in lines for frame in parser.feed(one)], parser.counters


def test_fewer_counts_are_more_load_on_both_feet() -> None:
    right, left = [*range(4095, 4079, -1)], [863, *UNLOADED[1:]]
    frames, counters = fed(BANNER, line(7, right, left))
    assert [(one.foot, one.sequence, one.ticks, one.bits) for one in frames] == [
        ("left", 7, 350_000, 12),
        ("right", 7, 350_000, 12),
    ]
    assert frames[1].cells == tuple(range(16))
    assert frames[0].cells == (3232, *[0] * 15)
    assert (counters.bytes_dropped, counters.malformed) == (0, 0)


@pytest.mark.parametrize(
    ("right", "left", "flags", "missing"),
    [
        (UNLOADED, GONE, 3, "left"),  # as its logs begin, before the left board answers
        (UNLOADED, UNLOADED, 1, "left"),
        (GONE, UNLOADED, 2, "right"),  # the other board's scan came when its own had been written
    ],
)
def test_a_foot_that_did_not_come_is_missing_and_not_at_full_load(
    right: list[int], left: list[int], flags: int, missing: str
) -> None:
    frames, _ = fed(line(1, right, left, flags))
    assert {one.foot: one.missing for one in frames} == {foot: foot == missing for foot in ("left", "right")}
    assert {one.foot: one.cells[0] for one in frames}[missing] is None  # type: ignore[index]


def test_a_scan_that_was_waited_for_is_whole_but_late_behind_the_next() -> None:
    frames, counters = fed(
        line(289, UNLOADED, UNLOADED),
        line(291, UNLOADED, UNLOADED),
        line(290, UNLOADED, UNLOADED, 2),
        line(292, UNLOADED, UNLOADED),
    )
    assert [(one.sequence, one.late) for one in frames if one.foot == "left"] == [
        (289, False),
        (291, False),
        (290, True),
        (292, False),
    ]
    assert not any(one.missing for one in frames)
    assert (counters.sequence_gaps, counters.out_of_order) == (1, 1)


@pytest.mark.parametrize(
    "damaged",
    [
        line(2, UNLOADED, [4096, *UNLOADED[1:]]),  # more than its converter has
        line(2, UNLOADED, [-1, *UNLOADED[1:]]),
        line(2, UNLOADED, UNLOADED, 4),
        line(2, UNLOADED, UNLOADED[1:]),
        line(2, UNLOADED, [*UNLOADED, 4095]),
        line(2, UNLOADED, UNLOADED).replace(b"4095", b"40.5", 1),
        line(2, UNLOADED, UNLOADED).replace(b"4095", b"", 1),
        line(2, UNLOADED, UNLOADED)[:40] + b"\r\n",
        line(2, UNLOADED, UNLOADED).replace(b"4095", b"4\xff95", 1),
    ],
)
def test_a_damaged_line_is_dropped_and_the_next_one_counts(damaged: bytes) -> None:
    frames, counters = fed(line(1, UNLOADED, UNLOADED), damaged, line(3, UNLOADED, UNLOADED))
    assert [one.sequence for one in frames] == [1, 1, 3, 3]
    assert counters.bytes_dropped == len(damaged) - 1


def test_a_stream_that_begins_in_its_header_or_a_line_is_in_step_at_the_next() -> None:
    for beginning in (HEADER[3:] + b"\r\n", HEADER[-40:] + b"\r\n", line(1, UNLOADED, UNLOADED)[20:]):
        frames, _ = fed(beginning, line(2, UNLOADED, UNLOADED))
        assert [one.sequence for one in frames] == [2, 2]


def test_other_columns_of_the_same_number_are_no_scan_until_another_stream_begins() -> None:
    swapped = HEADER.replace(b"R_", b"x_").replace(b"L_", b"R_").replace(b"x_", b"L_")
    parser = BrilliantStarParser()
    assert parser.feed(swapped + b"\n" + STREAM[0]) == []
    parser.finish()
    assert len(parser.feed(STREAM[1])) == 2


def test_every_split_point() -> None:
    stream = BANNER + STREAM[0] + b"\xff\n" + STREAM[1]
    assert_same_at_every_split(BrilliantStarParser, stream, parse(BrilliantStarParser, stream))


def test_the_format_brings_its_cells_and_a_named_layout_wins() -> None:
    feet = insoles({"left_insole": InsoleSettings(port="-", format="brilliant-star")})
    assert feet[0].layout is LAYOUT is FORMAT.layout
    assert tuple(tuple(cell) for cell in simulated.CELLS) == LAYOUT.cells
    named = InsoleSettings(port="-", format="brilliant-star", layout="insole-16")
    assert insoles({"left_insole": named})[0].layout == load("insole-16")


def test_it_is_recognised_with_and_without_its_header_and_its_table_names_no_layout() -> None:
    for stream in (BANNER + b"".join(STREAM), b"".join(STREAM)[50:]):
        match = recognise(stream)
        assert match is not None
        assert (match.format_name, match.layout, match.cells) == ("brilliant-star", None, 16)
        assert 'format = "brilliant-star"\n' in table(SERIAL, 115200, match)
        assert "layout" not in table(SERIAL, 115200, match)


def test_like_columns_of_a_converter_that_is_not_inverted_stay_lines_that_need_a_layout() -> None:
    header = "time_ms,seq," + ",".join(f"{foot}_ch{n}" for foot in "LR" for n in range(16)) + ",flags\n"
    match = recognise(header.encode("ascii") + b"".join(STREAM))
    assert match is not None
    assert match.format_name == "insole-csv"
