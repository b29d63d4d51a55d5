"""What every format does at the end of a stream: the next one may count anew."""

from typing import Any

import pytest

from drivers.imu.formats import FORMATS
from drivers.insole import layout as layouts
from drivers.insole.formats import parser_maker
from drivers.parsing import Parser
from tests.unit.port.streams import Make
from tests.unit.sensor_cli.streams import streams

MAKERS: dict[str, Make[Any]] = {
    **{name: one.make_parser for name, one in FORMATS.items()},
    "insole-cobs": parser_maker("insole-cobs", None),
    "insole-frame": parser_maker("insole-frame", layouts.load("insole-18")),
    "insole-csv": parser_maker("insole-csv", layouts.load("insole-8")),
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
