"""CAN logs and captures as files: every format the same, and what is broken is named."""

import itertools
import json
from pathlib import Path

import can
import pytest

from hil_sim.bus.can_bus import Frame
from hil_sim.replay import capture
from hil_sim.replay.can_log import CanLog, ReplayError

START_S = 1_700_000_000.25
FRAMES = [
    Frame(0x080),
    Frame(0x181, b"\x37\x16\x00\x01\x02\x03"),
    Frame(0x1ABCDEF0, b"\x01", extended=True),
    Frame(0x182, remote=True),
    None,  # an error frame
    Frame(0x702, b"\x05"),
]


def write(path: Path) -> Path:
    """`FRAMES` by python-can's own writer, a millisecond apart."""
    with can.Logger(path) as logger:
        for number, frame in enumerate(FRAMES):
            logger(message(frame, START_S + number / 1000))
    return path


def message(frame: Frame | None, stamp_s: float) -> can.Message:
    if frame is None:
        return can.Message(timestamp=stamp_s, is_error_frame=True, is_extended_id=False, channel=0)
    return can.Message(
        timestamp=stamp_s,
        arbitration_id=frame.cob_id,
        data=frame.data,
        is_extended_id=frame.extended,
        is_remote_frame=frame.remote,
        channel=0,
    )


def candump(path: Path, *lines: str) -> Path:
    path.write_text("".join(f"{line}\n" for line in lines), encoding="ascii")
    return path


def refusal(path: Path, channel: str | None = None) -> str:
    with pytest.raises(ReplayError) as refused:
        list(CanLog(path, channel))
    return str(refused.value)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_every_format_gives_the_same_frames_a_millisecond_apart(tmp_path: Path, suffix: str) -> None:
    log = CanLog(write(tmp_path / f"can{suffix}"))
    read = list(log)
    assert [one.frame for one in read] == FRAMES
    steps = [later.stamp_ns - one.stamp_ns for one, later in itertools.pairwise(read)]
    assert steps == pytest.approx([1_000_000] * 5, abs=1000)
    assert list(log) == read  # again and again


@pytest.mark.parametrize("suffix", [".log", ".blf"])
def test_stamps_are_unix_time_where_the_file_says_it(tmp_path: Path, suffix: str) -> None:
    first = next(iter(CanLog(write(tmp_path / f"can{suffix}"))))
    assert first.stamp_ns / 1e9 == pytest.approx(START_S, abs=0.002)


@pytest.mark.parametrize("identifier", ["20000004", "20000088", "200000AC"])
def test_every_class_of_error_frames_is_one(tmp_path: Path, identifier: str) -> None:
    path = candump(tmp_path / "can.log", f"(1.000000) can0 {identifier}#000C000000000000")
    assert [one.frame for one in CanLog(path)] == [None]


def test_stamps_a_little_out_of_order_are_put_in_order(tmp_path: Path) -> None:
    path = candump(
        tmp_path / "can.log", "(2.0) can0 101#", "(1.5) can0 102#", "(1.2) can0 103#", "(4.0) can0 104#"
    )
    assert [one.frame.cob_id for one in CanLog(path) if one.frame] == [0x103, 0x102, 0x101, 0x104]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["(1.0) can0 101#00", "(1.1) can0 10"], "line 2: this cannot be read as a log"),
        (["(1.0) can0 101#00", "", "no line"], "line 3: this cannot be read as a log"),
        (["(1.0) can0 101#001"], "line 1: this is no line of candump -l"),
        (["(1.0) can0 0101#00"], "line 1: this is no line of candump -l"),
        (["(1.0) can0 101#112233445566778899"], "line 1: a CAN FD frame"),
        (["(1.0) can0 101##0112233"], "line 1: a CAN FD frame"),
        (["(1.0) can0 901#00"], "line 1: 901 is no identifier"),
        (
            ["(1.0) can0 101#00", "(3602.0) can0 101#00"],
            "line 2: the stamps jump by +3601.000 s; cut the file there",
        ),
        (
            ["(9.0) can0 101#00", "(7.5) can0 101#00"],
            "line 2: the stamps jump by -1.500 s; cut the file there",
        ),
        (["(1.0) can0 101#00", "(1.1) can1 101#00"], "line 2: a frame of channel can1 beside those of can0"),
        ([], "holds no CAN frame"),
    ],
)
def test_a_broken_log_is_refused_with_file_and_line(tmp_path: Path, lines: list[str], words: str) -> None:
    said = refusal(candump(tmp_path / "can.log", *lines))
    assert said.startswith(str(tmp_path / "can.log"))
    assert words in said


def test_a_log_that_ends_within_a_line_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "can.log"
    path.write_text("(1.0) can0 101#0011\n(1.1) can0 101#00", encoding="ascii")  # was 0011
    assert refusal(path) == f"{path}, line 2: the file ends in the middle of this line: delete it"


@pytest.mark.parametrize("part", [0, 3, 100, 200])
def test_a_cut_off_blf_is_refused(tmp_path: Path, part: int) -> None:
    path = write(tmp_path / "can.blf")
    path.write_bytes(path.read_bytes()[:part])
    assert refusal(path).startswith(str(path))


def test_asc_with_relative_stamps_is_refused(tmp_path: Path) -> None:
    path = candump(
        tmp_path / "can.asc",
        "date Sat Nov 21 10:00:00.000 AM 2026",
        "base hex  timestamps relative",
        "internal events logged",
        "Begin Triggerblock Sat Nov 21 10:00:00.000 AM 2026",
        "  0.001000 1  181             Rx   d 1 00",
    )
    assert "save it with absolute ones" in refusal(path)


def test_asc_whose_bytes_are_fewer_than_it_says_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "can.asc")
    path.write_text(path.read_text(encoding="ascii").replace("02 03", "02"), encoding="ascii")
    assert "5 bytes where the length says 6" in refusal(path)


def test_one_of_several_channels_is_chosen(tmp_path: Path) -> None:
    path = candump(tmp_path / "can.log", "(1.0) can0 101#00", "(1.1) can1 102#00")
    assert [one.frame for one in CanLog(path, "can1")] == [Frame(0x102, b"\0")]
    assert refusal(path, "can2") == f"{path} holds no CAN frame of channel can2"


@pytest.mark.parametrize("suffix", [".asc", ".blf"])
def test_channels_are_counted_as_in_the_file(tmp_path: Path, suffix: str) -> None:
    log = CanLog(write(tmp_path / f"can{suffix}"), "1")
    assert len(list(log)) == len(FRAMES)


def test_a_file_that_is_missing_or_of_no_known_format_is_named(tmp_path: Path) -> None:
    assert refusal(tmp_path / "no.log") == f"{tmp_path / 'no.log'} cannot be read: No such file or directory"
    assert "give .log, .asc, .blf" in refusal(tmp_path / "can.txt")


def test_a_captures_bytes_are_spread_over_its_time(tmp_path: Path) -> None:
    file = tmp_path / "left.bin"
    file.write_bytes(bytes(range(100)))
    (tmp_path / "left.bin.json").write_text('{"baudrate": 230400, "seconds": 1.0}', encoding="ascii")
    pieces = list(capture.load(file).pieces(first_ns=7_000_000_000))
    assert b"".join(data for _, data in pieces) == bytes(range(100))
    come = 0
    for stamp_ns, data in pieces:
        come += len(data)
        assert come == pytest.approx((stamp_ns - 7_000_000_000) / 1e7, abs=1)


@pytest.mark.parametrize(
    ("data", "about", "words"),
    [
        (None, {}, "left.bin cannot be read"),
        (b"x", None, "left.bin.json cannot be read"),
        (b"", {"baudrate": 9600, "seconds": 1.0}, "left.bin is empty"),
        (b"x", [], "left.bin.json is no object"),
        (b"x", {"seconds": 1.0}, "baudrate None"),
        (b"x", {"baudrate": 9601, "seconds": 1.0}, "baudrate 9601"),
        (b"x", {"baudrate": 9600}, "seconds is None"),
        (b"x", {"baudrate": 9600, "seconds": "1"}, "seconds is 1, not a number"),
        (b"x", {"baudrate": 9600, "seconds": 0}, "in 0 seconds nothing comes"),
        (b"x", {"baudrate": 9600, "seconds": 1, "began_s": True}, "began_s is True"),
    ],
)
def test_a_capture_that_is_none_is_refused(
    tmp_path: Path, data: bytes | None, about: object, words: str
) -> None:
    if data is not None:
        (tmp_path / "left.bin").write_bytes(data)
    if about is not None:
        (tmp_path / "left.bin.json").write_text(json.dumps(about), encoding="ascii")
    with pytest.raises(ReplayError) as refused:
        capture.load(tmp_path / "left.bin")
    assert words in str(refused.value)
