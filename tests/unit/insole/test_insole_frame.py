"""Format `insole-frame`: frames that devices really send, and every way to describe one."""

import struct
from pathlib import Path

import msgspec
import pytest

from drivers.errors import SettingsError
from drivers.insole import layout as layouts
from drivers.insole.description import FrameDescription
from drivers.insole.formats import FORMATS
from drivers.insole.formats.insole_frame import CHECKSUMS, InsoleFrameParser
from tests.unit.insole.encode import crc16_ccitt_false, eighteen_cell_frame
from tests.unit.port.streams import assert_damage_is_contained, assert_same_at_every_split, parse

STREAM = [eighteen_cell_frame(1 + n % 2, [n] * 18) for n in range(60)]

EIGHTEEN = FORMATS["insole-frame"].parser(layouts.load("insole-18"))
GRID = FORMATS["insole-frame"].parser(layouts.load("insole-35"))

# Sent by a 35-cell ESP32 insole with ten cells fitted; an example in its public parser.
SENT = bytes.fromhex(
    "5a5ae00ad6773866b7013701000038010000380100003801000037010000390100003a0100003a0100003a0100003b01"
    "0000000080400000604100001c42ffff793dfffff9bd000000000000553d0000d3bc00e07e3fa5a5"
)


def describe(**changes: object) -> FrameDescription:
    fields = [{"name": "cells", "type": "u16", "count": 2}]
    return msgspec.convert({"header": "AB CD", "fields": fields} | changes, FrameDescription)


def test_frame_that_a_device_sent() -> None:
    (frame,) = parse(GRID, SENT)
    assert frame.cells == (311, 312, 312, 312, 311, 313, 314, 314, 314, 315)
    assert frame.ticks == 1_714_976_726_439_000
    assert (frame.more["id"], frame.more["n"]) == (224, 10)
    acceleration = frame.more["acceleration"]
    assert acceleration == pytest.approx([g * 9.80665 for g in (0.052, -0.0258, 0.9956)], abs=1e-3)
    assert not frame.calibrated


def test_eighteen_cells_of_both_feet() -> None:
    stream = eighteen_cell_frame(1, range(18)) + eighteen_cell_frame(2, [0xFFFF] * 18)
    left, right = parse(EIGHTEEN, stream)
    assert len(stream) == 2 * 39
    assert (left.foot, left.cells) == ("left", tuple(range(18)))
    assert (right.foot, right.cells[0]) == ("right", 65535)


@pytest.mark.parametrize("make", [EIGHTEEN, GRID])
def test_every_split_point(make: object) -> None:
    stream = SENT * 3 if make is GRID else eighteen_cell_frame(1, [0xAA] * 18) * 3
    maker = GRID if make is GRID else EIGHTEEN
    assert_same_at_every_split(maker, stream, parse(maker, stream))


def test_every_damaged_byte() -> None:
    frames = [eighteen_cell_frame(1 + n % 2, [n * 100 + cell for cell in range(18)]) for n in range(6)]
    assert_damage_is_contained(EIGHTEEN, frames, damaged=2)


def test_frame_without_a_checksum_is_in_step_again_after_two_frames() -> None:
    for at in range(len(SENT)):
        damaged = bytearray(SENT)
        damaged[at] ^= 0xFF
        assert len(parse(GRID, SENT, bytes(damaged), SENT, SENT, SENT)) >= 3, at


@pytest.mark.parametrize(
    ("name", "checksum"),
    [
        ("sum8", bytes([(0xAB + 0xCD + 1 + 2 + 3 + 4) & 0xFF])),
        ("xor8", bytes([0xAB ^ 0xCD ^ 1 ^ 2 ^ 3 ^ 4])),
        ("crc16-ccitt-false", crc16_ccitt_false(bytes.fromhex("abcd01020304")).to_bytes(2, "little")),
    ],
)
def test_checksums_cover_all_before_them(name: str, checksum: bytes) -> None:
    body = bytes.fromhex("abcd01020304")
    parser = InsoleFrameParser(describe(checksum=name))
    assert [frame.cells for frame in parser.feed(body + checksum)] == [(0x0201, 0x0403)]
    assert parser.feed(body + bytes([checksum[0] ^ 1]) + checksum[1:]) == []
    assert parser.counters.bad_checksums == 1


@pytest.mark.parametrize(
    ("name", "value"), [("crc16-ccitt-false", 0x29B1), ("crc16-xmodem", 0x31C3), ("crc16-modbus", 0x4B37)]
)
def test_check_values_of_the_crcs(name: str, value: int) -> None:
    assert CHECKSUMS[name][1](b"123456789") == value


def test_checksum_may_leave_out_the_header_and_a_terminator_may_follow() -> None:
    body = bytes.fromhex("01020304")
    wire = b"\xab\xcd" + body + bytes([sum(body)]) + b"\r\n"
    parser = InsoleFrameParser(describe(checksum="sum8", checksum_from=2, terminator="0D 0A"))
    assert len(parser.feed(wire)) == 1
    assert parser.feed(wire[:-1] + b"\0") == []


def test_types_order_scale_flags_and_pressure() -> None:
    description = describe(
        byte_order="big",
        fields=[
            {"name": "flags", "type": "u8"},
            {"name": "sequence", "type": "u8"},
            {"name": "temperature", "type": "i16", "scale": 0.01},
            {"name": "cells", "type": "f32", "count": 2},
        ],
        flags=[
            {"source": "flags", "mask": 1, "means": "saturated"},
            {"source": "flags", "mask": 2, "means": "missing"},
        ],
        pascal_per_count=1000.0,
    )

    def wire(flags: int, sequence: int) -> bytes:
        return b"\xab\xcd" + struct.pack(">BBhff", flags, sequence, 3150, 1.5, 2.5)

    parser = InsoleFrameParser(description)
    plain, saturated, missing = parser.feed(wire(0, 255) + wire(1, 0) + wire(2, 3))
    assert plain.calibrated
    assert plain.cells == (1500.0, 2500.0)
    assert plain.more["temperature"] == pytest.approx(31.5)
    assert saturated.saturated
    assert missing.cells == (None, None)
    assert (parser.counters.saturated, parser.counters.frames_missed) == (1, 2)


def test_unknown_foot_and_not_a_number_are_malformed() -> None:
    parser = EIGHTEEN()
    assert parser.feed(eighteen_cell_frame(3, [0] * 18)) == []
    assert parser.counters.malformed == 1
    floats = InsoleFrameParser(describe(fields=[{"name": "cells", "type": "f32"}]))
    assert floats.feed(b"\xab\xcd" + struct.pack("<f", float("nan"))) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"header": ""}, "header"),
        ({"header": "A"}, "bytes in hex"),
        ({"fields": [{"name": "x", "type": "u8"}]}, "one field named `cells`"),
        ({"fields": [{"name": "cells", "type": "u8", "count": "n"}]}, "no field 'n' before it"),
        (
            {"fields": [{"name": "n", "type": "f32"}, {"name": "cells", "type": "u8", "count": "n"}]},
            "its count 'n' must be a whole number",
        ),
        ({"fields": [{"name": "cells", "type": "u9"}]}, "u9"),
        ({"time": {"t": 0.001}}, "name no field: t"),
    ],
)
def test_wrong_description_is_named(changes: dict[str, object], words: str) -> None:
    with pytest.raises(msgspec.ValidationError, match=words):
        describe(**changes)


def test_format_without_a_description_says_what_it_needs(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"table \[frame\]"):
        FORMATS["insole-frame"].parser(layouts.load("insole-16"))


def test_count_that_would_never_end_is_no_frame() -> None:
    description = describe(
        fields=[{"name": "n", "type": "u32"}, {"name": "cells", "type": "u16", "count": "n"}]
    )
    parser = InsoleFrameParser(description)
    assert parser.feed(b"\xab\xcd\xff\xff\xff\xff" + b"\xab\xcd\x01\x00\x00\x00\x07\x00") != []
    assert parser.counters.bytes_dropped == 6


def test_a_count_below_zero_is_no_frame() -> None:
    description = describe(
        fields=[{"name": "n", "type": "i16"}, {"name": "cells", "type": "u8", "count": "n"}]
    )
    parser = InsoleFrameParser(description)
    (frame,) = parser.feed(b"\xab\xcd\x00\x80" + b"\xab\xcd\xff\xff" + b"\xab\xcd\x01\x00\x07")
    assert frame.cells == (7,)
    assert parser.counters.bytes_dropped == 8


def test_a_time_that_no_device_can_mean_is_malformed() -> None:
    description = describe(
        fields=[{"name": "t", "type": "f32"}, {"name": "cells", "type": "u8"}], time={"t": 1.0}
    )
    parser = InsoleFrameParser(description)
    assert parser.feed(b"\xab\xcd" + struct.pack("<fB", 1e38, 7)) == []
    assert parser.counters.malformed == 1
    assert len(parser.feed(b"\xab\xcd" + struct.pack("<fB", 1.5, 7))) == 1
