"""What every format does at the end of a stream, and with lines that are too long."""

from typing import Any

import pytest

from drivers.imu.can.witmotion_can import WitmotionCanParser
from drivers.imu.formats import FORMATS as IMUS
from drivers.imu.formats.vectornav import VectornavParser
from drivers.insole import layout as layouts
from drivers.insole.description import CsvDescription
from drivers.insole.formats import FORMATS as INSOLES
from drivers.insole.formats.insole_csv import InsoleCsvParser
from drivers.parsing import Parser
from tests.unit.port.streams import Make
from tests.unit.sensor_cli.streams import streams

DESCRIBED = {"insole-frame": layouts.load("insole-18"), "insole-csv": layouts.load("insole-8")}
MAKERS: dict[str, Make[Any]] = {
    **{name: one.parser for name, one in IMUS.items()},
    **{name: one.parser(DESCRIBED.get(name)) for name, one in INSOLES.items()},
}
CSV = b"".join(b"%d;%d;L;0;1;2;3;4;5;6;7;8\r\n" % (10 * n, n) for n in range(60))


@pytest.mark.parametrize("name", MAKERS)
def test_a_stream_that_begins_again_is_not_late_and_the_counters_go_on(name: str) -> None:
    data = CSV if name == "insole-csv" else streams()[name]
    parser: Parser[Any] = MAKERS[name]()
    first = parser.feed(data) + parser.finish()
    second = parser.feed(data) + parser.finish()
    assert len(first) == len(second) > 50
    assert parser.counters.out_of_order == 0
    assert parser.counters.frames == len(first) + len(second)


def csv_parser() -> InsoleCsvParser:
    return InsoleCsvParser(CsvDescription())


def test_a_line_that_is_too_long_is_dropped_however_it_comes() -> None:
    stream = b"ch1,ch2\n1,2\n" + b"3," * InsoleCsvParser.longest + b"4\n5,6\n"
    for size in (1, 100, len(stream)):
        parser = csv_parser()
        frames = [one for at in range(0, len(stream), size) for one in parser.feed(stream[at : at + size])]
        assert [frame.cells for frame in frames] == [(1, 2), (5, 6)], f"in pieces of {size}"


def test_a_line_that_the_end_has_cut_off_does_not_cost_the_next_stream_its_first() -> None:
    parser = csv_parser()
    parser.feed(b"9" * (InsoleCsvParser.longest + 1))
    assert parser.finish() == []
    parser.feed(b"ch1,ch2\n")
    assert [frame.cells for frame in parser.feed(b"1,2\n")] == [(1, 2)]


def test_bytes_between_frames_are_counted_alike_however_they_come() -> None:
    """What means nothing between frames does not count inside what is dropped either."""
    stream = b"$WNYPR,1\r\n$-002.026*60\r\n$VNACC,1$VNYPR,,2,3*6C\r\n"
    dropped = set()
    for size in (1, 3, len(stream)):
        parser = VectornavParser()
        for at in range(0, len(stream), size):
            parser.feed(stream[at : at + size])
        parser.finish()
        dropped.add(parser.counters.bytes_dropped)
    assert dropped == {len(stream) - stream.count(b"\r\n") * 2}


def test_heads_without_checksums_are_the_same_frames_however_they_come() -> None:
    stream = (
        b"UOU\x02UQabc\0\0UUUUUU\xab\xaa\xaa\xaa\xaa\xaa\xaa\xaaUUUUUUUUUUU\xaa\xaa\xaaUUUUUUUU\0UUUUU\xff"
    )
    found = set()
    for size in range(1, len(stream)):
        parser = WitmotionCanParser()
        frames = [one for at in range(0, len(stream), size) for one in parser.feed(stream[at : at + size])]
        found.add(repr(frames + parser.finish()))
    assert len(found) == 1
