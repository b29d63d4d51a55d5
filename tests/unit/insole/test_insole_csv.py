"""Format `insole-csv`: headers, feet, gaps, order, flags, inverted converters, and lines that are none."""

import msgspec
import pytest

from drivers.insole import layout as layouts
from drivers.insole.calibration import Cells
from drivers.insole.description import CsvDescription
from drivers.insole.formats import FORMATS
from drivers.insole.formats.insole_csv import InsoleCsvParser
from drivers.insole.frame import InsoleFrame
from tests.unit.port.streams import assert_same_at_every_split, parse

STREAM = [f"{n},{n + 1},{n + 2},{n + 3}\r\n".encode() for n in range(60)]

THREE = FORMATS["insole-csv"].parser(layouts.load("insole-3"))
EIGHT = FORMATS["insole-csv"].parser(layouts.load("insole-8"))
PLAIN = FORMATS["insole-csv"].parser(None)

BOTH_FEET = b"""# logger 1.2
time_ms,seq,L_ch0,L_ch1,L_ch2,R_ch0,R_ch1,R_ch2
1000,7,1,2,3,4,5,6
1010,8,11,12,13,14,15,16
"""


def make(**keys: object) -> InsoleCsvParser:
    return InsoleCsvParser(msgspec.convert(keys, CsvDescription))


def test_both_feet_in_a_line() -> None:
    frames = parse(THREE, BOTH_FEET)
    assert [(frame.foot, frame.cells, frame.sequence, frame.ticks) for frame in frames] == [
        ("left", (1, 2, 3), 7, 1_000_000),
        ("right", (4, 5, 6), 7, 1_000_000),
        ("left", (11, 12, 13), 8, 1_010_000),
        ("right", (14, 15, 16), 8, 1_010_000),
    ]


def test_common_names_need_no_description() -> None:
    assert parse(PLAIN, BOTH_FEET) == parse(THREE, BOTH_FEET)


def test_every_split_point() -> None:
    assert_same_at_every_split(THREE, BOTH_FEET, parse(THREE, BOTH_FEET))
    crlf = BOTH_FEET.replace(b"\n", b"\r\n")
    assert parse(THREE, crlf) == parse(THREE, BOTH_FEET)


def test_cells_stand_in_the_order_of_their_numbers() -> None:
    header = ",".join(f"ch{n}" for n in (10, 9, 2, 1))
    (frame,) = make().feed(f"{header}\n1,2,3,4\n".encode())
    assert frame.cells == (4, 3, 2, 1)


def test_one_foot_a_line_with_inverted_converter_and_missing_foot() -> None:
    text = b"0;1;L;0;4095;4095;4000;3000;4095;4095;4095;4095\n10;1;R;1;0;0;0;0;0;0;0;0\n"
    left, right = parse(EIGHT, text)
    assert (left.foot, right.foot) == ("left", "right")
    assert right.cells == (None,) * 8
    assert right.missing
    layout = layouts.load("insole-8")
    if layout.calibration is None:
        raise AssertionError("the example has a calibration")
    pressures = Cells(layout.calibration, 8).pressures(left.cells)
    assert pressures[0] == 0.0
    assert pressures[2] == pytest.approx(4.0 * 95**1.4)
    assert (pressures[3] or 0.0) > (pressures[2] or 0.0)


def rows(*numbers: int) -> bytes:
    return b"seq,ch0\n" + b"".join(f"{number},1\n".encode() for number in numbers)


def test_gaps_and_lines_out_of_order_are_counted() -> None:
    parser = make()
    frames = parser.feed(rows(1, 2, 5, 3, 4, 6, 6, 7))
    assert [frame.sequence for frame in frames if not frame.late] == [1, 2, 5, 6, 7]
    counters = parser.counters
    assert (counters.sequence_gaps, counters.frames_missed, counters.out_of_order) == (1, 2, 3)


def test_without_a_sequence_the_time_tells_what_is_late() -> None:
    parser = make()
    frames = parser.feed(b"time,ch0\n1.0,1\n1.1,2\n1.05,3\n1.2,4\n")
    assert [frame.late for frame in frames] == [False, False, True, False]
    assert (parser.counters.out_of_order, parser.counters.sequence_gaps) == (1, 0)


def test_each_foots_own_sequence() -> None:
    parser = make(sequence_of_each_foot=True)
    frames = parser.feed(b"seq,foot,ch0\n1,L,1\n1,R,1\n2,L,1\n2,R,1\n")
    assert [frame.late for frame in frames] == [False] * 4
    assert parser.counters.sequence_gaps == 0


def test_columns_by_place_without_a_header() -> None:
    parser = make(
        delimiter="\t", cells=[3, 2], left=[], right=[], time=0, time_unit="us", columns=["a", "b", "c", "d"]
    )
    (frame,) = parser.feed(b"250\t9\t1.5\t2.5\n")
    assert (frame.cells, frame.ticks) == ((2.5, 1.5), 250)


def test_empty_cell_is_missing_not_zero() -> None:
    (frame,) = make().feed(b"ch0,ch1\n5,\n")
    assert frame == InsoleFrame(cells=(5, None), missing=True)


@pytest.mark.parametrize("line", [b"1,x", b"1", b"1,inf", b"\xff\xfe,2"])
def test_line_that_is_no_scan_is_dropped_and_counted(line: bytes) -> None:
    parser = make()
    frames = parser.feed(b"ch0,ch1\n1,2\n" + line + b"\n3,4\n")
    assert [frame.cells for frame in frames] == [(1, 2), (3, 4)]
    assert parser.counters.bytes_dropped == len(line)


def test_wrong_foot_is_malformed() -> None:
    parser = make()
    assert parser.feed(b"foot,ch0\nX,1\n") == []
    assert parser.counters.malformed == 1


def test_lines_before_the_header_are_dropped() -> None:
    parser = make()
    assert len(parser.feed(b"4,5,6\nready\nch0,ch1\n1,2\n")) == 1
    assert parser.counters.bytes_dropped == len("4,5,6ready")


def test_flags_by_text_and_pressure_in_pascal() -> None:
    parser = make(flags=[{"source": "state", "equals": "SAT", "means": "saturated"}], pascal_per_count=1000.0)
    plain, saturated = parser.feed(b"state,ch0\nOK,1\nSAT,2\n")
    assert plain.calibrated
    assert plain.cells == (1000.0,)
    assert saturated.saturated
    assert parser.counters.saturated == 1


def test_endless_line_is_bounded() -> None:
    parser = make()
    for _ in range(1000):
        parser.feed(b"9" * 100)
    assert len(parser._buffer) <= parser.longest
    assert len(parser.feed(b"\nch0\n1\n")) == 1


def test_a_column_with_a_number_of_thousands_of_digits_is_a_column() -> None:
    parser = make()
    long = b"ch" + b"1" * 5000
    (frame,) = parser.feed(b"ch2," + long + b",ch01\n3,4,5\n")
    assert frame.cells == (5, 3, 4)


@pytest.mark.parametrize("line", [b"1e300,1,5", b"1,1" + b"0" * 40 + b",5", b"1,-9223372036854775809,5"])
def test_a_time_or_number_that_no_device_can_mean_is_malformed(line: bytes) -> None:
    parser = make()
    frames = parser.feed(b"time,seq,ch0\n" + line + b"\n2,2,6\n")
    assert [frame.cells for frame in frames] == [(6,)]
    assert parser.counters.malformed == 1
