"""Frames come out of a file as they went in, others read it, and damage is told with its place."""

import struct
from pathlib import Path

import can
import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.bus.frames import ERROR, EXTENDED, REMOTE
from drivers.errors import SettingsError
from drivers.trace.files import Captured, read, writing

T = 1_732_351_378_123_456_000
FRAMES = (
    Captured(T, 0x185, b"\x37\x02"),
    Captured(T + 1_000, 0x000, b""),
    Captured(T + 2_000, 0x12345678 | EXTENDED, bytes(range(8))),
    Captured(T + 3_000, 0x705 | REMOTE, b""),
    Captured(T + 4_000, 0x088 | ERROR, bytes(8)),
    Captured(T + 5_000, 0x004 | ERROR, b"\x00\x10\x00\x00\x00\x00\x00\x00"),
)


def written(path: Path, frames: tuple[Captured, ...]) -> Path:
    with writing(path) as put:
        for frame in frames:
            put(frame)
    return path


def frames_of(path: Path) -> tuple[Captured, ...]:
    """Without their interface, which a log always names and PCAP does not have."""
    return tuple(frame._replace(interface="") for frame in read(path))


@pytest.mark.parametrize("name", ["a.log", "a.pcap"])
def test_frames_of_every_kind_survive_a_file(tmp_path: Path, name: str) -> None:
    assert frames_of(written(tmp_path / name, FRAMES)) == FRAMES


_IDS = st.one_of(st.integers(0, 0x7FF), st.integers(0, 0x1FFF_FFFF).map(lambda one: one | EXTENDED))


@given(st.lists(st.tuples(st.integers(0, 10**9), _IDS, st.binary(max_size=8)), max_size=5))
def test_any_frames_survive_both_formats(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, int, bytes]]
) -> None:
    folder = tmp_path_factory.mktemp("any")
    frames = tuple(Captured(T + 1000 * offset, can_id, data) for offset, can_id, data in rows)
    for name in ("a.log", "a.pcap"):
        assert frames_of(written(folder / name, frames)) == frames


def test_python_can_reads_what_is_written_as_candump_does(tmp_path: Path) -> None:
    messages = list(can.CanutilsLogReader(written(tmp_path / "a.log", FRAMES[:4])))
    assert [(one.arbitration_id, bytes(one.data), one.is_extended_id) for one in messages] == [
        (0x185, b"\x37\x02", False),
        (0x000, b"", False),
        (0x12345678, bytes(range(8)), True),
        (0x705, b"", False),
    ]
    assert messages[3].is_remote_frame
    assert messages[0].timestamp == pytest.approx(T / 1e9)


def test_what_python_can_writes_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.log"
    with can.CanutilsLogWriter(path) as log:
        log.on_message_received(
            can.Message(T / 1e9, 0x185, is_extended_id=False, data=b"\x01", channel="can0")
        )
    (frame,) = read(path)
    assert (frame.can_id, frame.data) == (0x185, b"\x01")


def test_pcap_is_the_one_of_wireshark(tmp_path: Path) -> None:
    """The bytes of LINKTYPE_CAN_SOCKETCAN: the identifier big-endian, whatever the file's order is."""
    raw = written(tmp_path / "a.pcap", FRAMES[2:3]).read_bytes()
    assert struct.unpack_from("<IHHiIII", raw) == (0xA1B23C4D, 2, 4, 0, 0, 262144, 227)
    assert struct.unpack_from("<IIII", raw, 24) == (1_732_351_378, 123_458_000, 16, 16)
    assert raw[40:].hex(" ") == "92 34 56 78 08 00 00 00 00 01 02 03 04 05 06 07"


@pytest.mark.parametrize("order", "<>")
def test_both_byte_orders_and_microseconds_are_read(tmp_path: Path, order: str) -> None:
    path = tmp_path / "a.pcap"
    head = struct.pack(order + "IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 227)
    frame = bytes.fromhex("00 00 01 85 02 00 00 00 37 02")
    path.write_bytes(head + struct.pack(order + "IIII", 10, 7, len(frame), len(frame)) + frame)
    assert list(read(path)) == [Captured(10_000_007_000, 0x185, b"\x37\x02")]


_GOOD = "(1.000001) can0 185#3702\n"


@pytest.mark.parametrize(
    ("line", "number"),
    [
        ("(1.000001) can0 985#00", 2),  # 11 bits end at 7FF
        ("(1.000001) can0 185#000", 2),
        ("(1.000001) can0 185#" + "00" * 9, 2),
        ("(1.000001) can0 185##1112233", 2),
        ("can0 185 [2] 37 02", 2),
        ("\x00", 2),
    ],
)
def test_a_line_that_is_no_frame_is_told_by_its_number(tmp_path: Path, line: str, number: int) -> None:
    path = tmp_path / "a.log"
    path.write_text(_GOOD + line + "\n" + _GOOD, encoding="ascii")
    frames = read(path)
    assert next(frames).data == b"\x37\x02"
    with pytest.raises(SettingsError, match=rf"a\.log: line {number} is no frame"):
        next(frames)


@pytest.mark.parametrize("cut", [3, 23, 30, 41, 49])
def test_a_pcap_that_ends_early_is_told(tmp_path: Path, cut: int) -> None:
    path = written(tmp_path / "a.pcap", FRAMES[:1])
    path.write_bytes(path.read_bytes()[:cut])
    with pytest.raises(SettingsError, match=r"frame 1|no PCAP"):
        list(read(path))


def test_what_is_no_recording_of_a_can_bus_is_told(tmp_path: Path) -> None:
    ethernet = tmp_path / "a.pcap"
    ethernet.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))
    with pytest.raises(SettingsError, match="link type 1, not SocketCAN"):
        list(read(ethernet))
    ethernet.write_bytes(b"\x0a\x0d\x0d\x0a" + bytes(40))
    with pytest.raises(SettingsError, match="pcapng"):
        list(read(ethernet))
    with pytest.raises(SettingsError, match="cannot be read"):
        list(read(tmp_path / "none.log"))


def test_a_file_that_is_there_is_not_written_over(tmp_path: Path) -> None:
    path = written(tmp_path / "a.log", FRAMES)
    with pytest.raises(SettingsError, match="cannot be written"):
        written(path, ())
    assert frames_of(path) == FRAMES
