"""Bytes that somebody has crafted cost a parser little more than others: the work is counted, not timed."""

import sys
from typing import Any

import msgspec
import pytest

from drivers.bus.interfaces.socketcand import SocketcandParser, frame_of
from drivers.imu.can.witmotion_can import WitmotionCanParser
from drivers.imu.formats.bno08x_rvc import Bno08xRvcParser
from drivers.imu.formats.vectornav import VectornavParser
from drivers.imu.formats.witmotion import WitmotionParser
from drivers.imu.formats.xsens import XsensParser
from drivers.insole.description import CsvDescription, FrameDescription
from drivers.insole.formats.insole_cobs import InsoleCobsParser
from drivers.insole.formats.insole_csv import InsoleCsvParser
from drivers.insole.formats.insole_frame import InsoleFrameParser
from drivers.parsing import GRANT, SAVED, Counters, FrameScanner
from tests.unit.port.streams import Make

SHORT, FACTOR = 2048, 8
CALLS_A_BYTE = 64  # of functions, each of which is short
COUNTED_CELLS = {
    "header": "A5",
    "fields": [{"name": "n", "type": "u16"}, {"name": "cells", "type": "u8", "count": "n"}],
    "checksum": "crc16-modbus",
}
COUNT_COMES_LATE = {
    "header": "A5",
    "fields": [
        {"name": "blank", "type": "u8", "count": 1000},
        {"name": "n", "type": "u8"},
        {"name": "cells", "type": "u8", "count": "n"},
    ],
}


def insole_frame(description: dict[str, Any]) -> Make[Any]:
    described = msgspec.convert(description, FrameDescription)
    return lambda: InsoleFrameParser(described)


class CanLines:
    """The CAN server's messages, as a parser of bytes."""

    def __init__(self) -> None:
        self.counters = Counters()
        self._parser = SocketcandParser()

    def feed(self, data: bytes) -> list[Any]:
        return [frame_of(one, 0) for one in self._parser.feed(data.decode("latin-1"))]

    def finish(self) -> list[Any]:
        return []


# Beginnings as near to each other as can be, each with the longest length that the format allows.
CRAFTED: dict[str, tuple[Make[Any], bytes]] = {
    "xsens, extended lengths": (XsensParser, bytes.fromhex("FAFF36FF07FF")),
    "xsens, short lengths": (XsensParser, bytes.fromhex("FAFF36FD")),
    "xsens, preambles": (XsensParser, bytes.fromhex("FAFF")),
    "vectornav, binary": (VectornavParser, bytes.fromhex("FA01FF7F")),
    "vectornav, all groups": (VectornavParser, bytes.fromhex("FA37FA01FA03FA03FA01FA01")),
    "vectornav, binary beginnings": (VectornavParser, b"\xfa"),
    "vectornav, text beginnings": (VectornavParser, b"$"),
    "vectornav, text without end": (VectornavParser, b"$" + b"A" * 254),
    "vectornav, checksums": (VectornavParser, b"$*00"),
    "bno08x": (Bno08xRvcParser, b"\xaa"),
    "witmotion": (WitmotionParser, b"\x55"),
    "witmotion, heads": (WitmotionParser, b"\x55\x51"),
    "witmotion-can": (WitmotionCanParser, b"\x55\x51\x55"),
    "insole-frame, counted cells": (insole_frame(COUNTED_CELLS), bytes.fromhex("A5F00F")),
    "insole-frame, headers": (insole_frame(COUNTED_CELLS), bytes.fromhex("A5")),
    "insole-frame, a late count": (insole_frame(COUNT_COMES_LATE), bytes.fromhex("A5")),
    "insole-cobs, no end": (InsoleCobsParser, b"\x01"),
    "insole-cobs, ends": (InsoleCobsParser, b"\x01\0"),
    "insole-csv, no end": (lambda: InsoleCsvParser(CsvDescription()), b"ch1,"),
    "insole-csv, headers": (lambda: InsoleCsvParser(CsvDescription()), b"ch1\n"),
    "insole-csv, wide headers": (lambda: InsoleCsvParser(CsvDescription()), b"L_ch1," * 200 + b"\n"),
    "socketcand, no end": (CanLines, b"<"),
    "socketcand, ends": (CanLines, b"<>"),
}  # fmt: skip


def work(make: Make[Any], data: bytes, size: int) -> int:
    """Calls of functions, Python's own too, while `data` is fed in pieces of `size` bytes."""
    calls = 0

    def count(_frame: object, event: str, _about: object) -> None:
        nonlocal calls
        calls += event in ("call", "c_call")

    parser = make()
    sys.setprofile(count)
    try:
        for at in range(0, len(data), size):
            parser.feed(data[at : at + size])
    finally:
        sys.setprofile(None)
    return calls


def repeated(pattern: bytes, length: int) -> bytes:
    return (pattern * (length // len(pattern) + 1))[:length]


@pytest.mark.parametrize("name", CRAFTED)
@pytest.mark.parametrize("size", [1, 1 << 20], ids=["byte by byte", "at once"])
def test_crafted_bytes_cost_a_bounded_number_of_calls_each(name: str, size: int) -> None:
    make, pattern = CRAFTED[name]
    assert work(make, repeated(pattern, 2 * SHORT), size) <= CALLS_A_BYTE * 2 * SHORT


@pytest.mark.parametrize("name", CRAFTED)
def test_eight_times_the_bytes_are_eight_times_the_calls(name: str) -> None:
    make, pattern = CRAFTED[name]
    short, long = (work(make, repeated(pattern, length), 256) for length in (SHORT, SHORT * FACTOR))
    assert long <= 2 * FACTOR * short


@pytest.mark.parametrize(
    "name", [name for name, (make, _) in CRAFTED.items() if isinstance(make(), FrameScanner)]
)
def test_no_byte_is_looked_at_much_more_often_than_granted(name: str) -> None:
    make, pattern = CRAFTED[name]
    parser = make()
    assert isinstance(parser, FrameScanner)
    parser.feed(repeated(pattern, SHORT * FACTOR))
    assert parser.looked_at <= SAVED + GRANT * SHORT * FACTOR


def test_after_crafted_bytes_frames_arrive_again() -> None:
    frame = b"\xfa\xff\x3e\x00\xc3"
    parser = XsensParser()
    parser.feed(repeated(bytes.fromhex("FAFF36FF07FF"), SHORT * FACTOR) + bytes(4096))
    assert [one.kind for one in parser.feed(frame * 3)] == ["wake_up"] * 3


def test_what_is_looked_at_does_not_depend_on_how_the_bytes_come() -> None:
    crafted = repeated(bytes.fromhex("A5F00F"), SHORT * FACTOR)
    parsers = [insole_frame(COUNTED_CELLS)() for _ in range(2)]
    parsers[0].feed(crafted)
    for at in range(len(crafted)):
        parsers[1].feed(crafted[at : at + 1])
    assert parsers[0].counters == parsers[1].counters
