"""`gwrms sensor`: decode, identify, record and replay, from the command line."""

import io
import json
import math
import os
import random
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.cli import listen, live, sensor
from drivers.errors import SettingsError, Unavailable
from drivers.identify import Match
from drivers.port import SerialPort
from tests.support.waiting import WAIT_S, until
from tests.unit.port.terminals import Terminal, send_until
from tests.unit.sensor_cli.streams import capture, streams

ANGLE = bytes.fromhex("55 53 04 0c e1 ff 6f f2 cc 46 0b")
CAN_LOG = bytes.fromhex("55 51 e4 ff e2 04 3d 06 55 53 05 1b 80 00 01 40")


PAUSE_S = 0.01


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Terminal]:
    terminal = Terminal(tmp_path / "sensor")
    terminal.plug_in()
    yield terminal
    terminal.unplug()


class Talking:
    """A device that sends the same bytes again and again, until told to stop.

    Who listens for so many seconds hears what it sends in as many, however late this computer lets it.
    """

    def __init__(self, terminal: Terminal, data: bytes) -> None:
        self._stop = threading.Event()
        self._clock = pytest.MonkeyPatch()
        self._sent_s = 0.0
        self._terminal, self._data = terminal, data
        self._thread = threading.Thread(target=self._talk)

    def __enter__(self) -> "Talking":
        self._clock.setattr(listen, "time", SimpleNamespace(monotonic=lambda: self._sent_s))
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._clock.undo()

    def _talk(self) -> None:
        at = 0
        while not self._stop.wait(PAUSE_S):
            self._terminal.send((self._data * 2)[at : at + 64])
            self._sent_s += PAUSE_S
            at = (at + 64) % len(self._data)


def lines(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize("name", [name for name in streams() if name != "insole-csv"])
def test_decode_prints_a_line_a_frame_and_the_counters(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = ["--layout", "insole-18"] if name == "insole-frame" else []
    path = capture(tmp_path, streams()[name])
    assert sensor.main(["decode", "--format", name, *layout, str(path)]) == 0
    *frames, last = lines(capsys)
    assert len(frames) >= 55
    assert all("frame" in frame for frame in frames)
    assert list(last) == ["counters"]
    assert last["counters"]["frames"] == len(frames)


def test_decode_gives_si_and_radians(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sensor.main(["decode", "--format", "witmotion", str(capture(tmp_path, ANGLE))]) == 0
    angle, _ = lines(capsys)
    assert angle["frame"] == "angle"
    assert angle["roll"] == pytest.approx(math.radians(16.897), abs=1e-5)


def test_decode_reads_standard_input(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(CAN_LOG)))
    assert sensor.main(["decode", "--format", "witmotion-can"]) == 0
    assert [line.get("frame") for line in lines(capsys)] == ["acceleration", "angle", None]


def test_decode_with_a_layout_adds_force_and_centre_of_pressure(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = capture(tmp_path, streams()["insole-cobs"])
    assert sensor.main(["decode", "--format", "insole-cobs", "--layout", "insole-16", str(path)]) == 0
    first, *_ = lines(capsys)
    assert first["force"] > 0.0
    assert "cop_x" in first


def test_decode_of_csv_with_an_own_layout_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    layout = tmp_path / "mine.toml"
    layout.write_text('name = "mine"\n[csv]\ncolumns = ["a", "b", "c", "d"]\ncells = ["b", "c", "d"]\n')
    path = capture(tmp_path, b"1,2,3,4\n5,6,7,8\n")
    assert sensor.main(["decode", "--format", "insole-csv", "--layout", str(layout), str(path)]) == 0
    assert [line["counts"] for line in lines(capsys)[:-1]] == [[2, 3, 4], [6, 7, 8]]


def test_decode_of_another_format_is_an_error_that_says_which(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = capture(tmp_path, streams()["witmotion"])
    assert sensor.main(["decode", "--format", "xsens", str(path)]) == 1
    said = capsys.readouterr()
    assert '"frames":0' in said.out
    assert f"{path}: " in said.err
    assert "belong to no frame of xsens, they are witmotion: say --format witmotion" in said.err


@pytest.mark.parametrize("noise", [b"", random.Random(1).randbytes(5000)])
def test_decode_of_what_is_no_format_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], noise: bytes
) -> None:
    path = capture(tmp_path, noise + ANGLE if noise else noise)
    assert sensor.main(["decode", "--format", "witmotion", str(path)]) == 1
    assert f"of {len(path.read_bytes())} bytes belong to no frame of witmotion\n" in capsys.readouterr().err


def test_decode_names_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"table \[frame\]"):
        sensor.main(["decode", "--format", "insole-frame", str(tmp_path / "x")])
    with pytest.raises(FileNotFoundError):
        sensor.main(["decode", "--format", "xsens", str(tmp_path / "x")])
    assert sensor.main(["decode", "--format", "morse"]) == 2


@pytest.mark.parametrize(
    ("name", "shown"),
    [("witmotion", "tilt_forward"), ("insole-cobs", "force"), ("insole-frame", "insole-18")],
)
def test_unknown_sensor_is_identified_and_shown_live(
    name: str,
    shown: str,
    terminal: Terminal,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.4)
    with Talking(terminal, streams()[name]):
        assert sensor.main([str(terminal.path), "--seconds", "1"]) == 0
    out = capsys.readouterr().out
    assert name in out
    assert f'port = "{terminal.path}"' in out
    assert ("axes = [" in out) == (name == "witmotion")
    assert shown in out


def test_identified_sensor_as_json(
    terminal: Terminal, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.4)
    with Talking(terminal, streams()["xsens"]):
        assert sensor.main([str(terminal.path), "--json"]) == 0
    (line,) = lines(capsys)
    assert line["found"]["match"]["format_name"] == "xsens"
    assert 'format = "xsens"\naxes = ["x","y","z"]' in line["table"]


def test_which_foot_an_insole_is_under_is_asked_where_its_frames_do_not_say() -> None:
    lines_of_numbers = Match("insole-csv", None, 20, 1.0, 3)
    assert live.table("/dev/x", 9600, lines_of_numbers).startswith("[insole.left_insole]  # or right_insole")


def test_silent_port_is_called_silent(
    terminal: Terminal, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.05)
    assert sensor.main([str(terminal.path), "--baud", "9600"]) == 1
    assert "power" in capsys.readouterr().err


def test_missing_port_is_named(tmp_path: Path) -> None:
    with pytest.raises(Unavailable, match="does not exist"):
        sensor.main([str(tmp_path / "nothing")])


def test_what_is_recorded_is_replayed_at_its_pace(
    terminal: Terminal, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    file, link = tmp_path / "walk.bin", tmp_path / "again"
    with Talking(terminal, streams()["bno08x-rvc"]):
        assert sensor.main(["record", str(terminal.path), str(file), "--seconds", "1"]) == 0
    assert file.stat().st_size > 500
    assert json.loads((tmp_path / "walk.bin.json").read_bytes())["format"] == "bno08x-rvc"
    monkeypatch.setattr(listen, "LISTEN_S", 0.5)
    replaying = threading.Thread(target=sensor.main, args=(["replay", str(file), "--link", str(link)],))
    replaying.start()
    try:
        until(link.exists, "the line is there")
        assert sensor.main([str(link), "--json"]) == 0
    finally:
        replaying.join()
    out = [json.loads(line) for line in capsys.readouterr().out.splitlines() if line.startswith("{")]
    assert out[-1]["found"]["match"]["format_name"] == "bno08x-rvc"
    assert not link.exists()


def test_a_recording_that_is_terminated_is_whole(terminal: Terminal, tmp_path: Path) -> None:
    file = tmp_path / "walk.bin"
    argv = [sys.executable, "-m", "gateway.main", "sensor", "record", str(terminal.path), str(file), "--raw"]
    with (
        Talking(terminal, streams()["witmotion"]),
        subprocess.Popen(argv, stdout=subprocess.PIPE) as recording,
    ):
        until(lambda: file.exists() and file.stat().st_size > 0)
        recording.terminate()
        told, _ = recording.communicate(timeout=WAIT_S)
    assert recording.returncode == 0
    assert told.startswith(f"{file.stat().st_size} bytes in ".encode())
    assert json.loads((tmp_path / "walk.bin.json").read_text())["baudrate"] == 115200


@pytest.mark.parametrize("signal_", [signal.SIGINT, signal.SIGTERM])
def test_a_recording_that_is_ended_while_it_begins_is_whole(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, signal_: signal.Signals
) -> None:
    file = tmp_path / "walk.bin"
    start = SerialPort.start

    def ended_while_starting(port: SerialPort) -> None:
        start(port)
        until(lambda: file.stat().st_size > 0)
        os.kill(os.getpid(), signal_)

    monkeypatch.setattr(SerialPort, "start", ended_while_starting)
    with Talking(terminal, streams()["witmotion"]):
        assert sensor.main(["record", str(terminal.path), str(file), "--raw"]) == 0
    assert (tmp_path / "walk.bin.json").exists()


def test_recording_never_overwrites(terminal: Terminal, tmp_path: Path) -> None:
    file = tmp_path / "walk.bin"
    file.write_bytes(b"precious")
    with pytest.raises(FileExistsError):
        sensor.main(["record", str(terminal.path), str(file), "--seconds", "0.1"])
    assert file.read_bytes() == b"precious"


@pytest.mark.parametrize(("how", "why"), [("--raw", "sent nothing"), ("--baud=9600", "is silent")])
def test_recording_of_silence_leaves_no_file(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: str, why: str
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.05)
    with pytest.raises(Unavailable, match=why):
        sensor.main(["record", str(terminal.path), str(tmp_path / "walk.bin"), "--seconds", "0.1", how])
    assert not (tmp_path / "walk.bin").exists()


def test_a_port_that_went_away_while_it_was_recorded_is_told_and_is_no_success(
    terminal: Terminal, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "walk.bin"

    def unplug() -> None:
        send_until(terminal, b"some", lambda: file.exists() and file.stat().st_size > 0, "it is recorded")
        terminal.unplug()

    unplugging = threading.Thread(target=unplug)
    unplugging.start()
    try:
        argv = ["record", str(terminal.path), str(file), "--seconds", "1.5", "--baud", "115200", "--raw"]
        assert sensor.main(argv) == 1
    finally:
        unplugging.join()
    out, told = capsys.readouterr()
    assert "went away: check its cable" in told
    assert "NOT all that was sent" in out


def test_noise_as_at_a_wrong_baud_rate_is_recorded_only_where_that_is_said(
    terminal: Terminal, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.2)
    file = tmp_path / "walk.bin"
    argv = ["record", str(terminal.path), str(file), "--seconds", "0.5", "--baud", "115200"]
    with Talking(terminal, random.Random(1).randbytes(4000)):
        with pytest.raises(Unavailable, match=r"no known format explains at 115200 baud.*--raw"):
            sensor.main(argv)
        assert not file.exists()
        assert sensor.main([*argv, "--raw"]) == 0
    assert file.stat().st_size > 0
    about = json.loads((tmp_path / "walk.bin.json").read_bytes())
    assert (about["baudrate"], about["format"]) == (115200, None)
    assert "at 115200 baud" in capsys.readouterr().out


@pytest.mark.parametrize(
    "words", [["--help"], ["decode", "--help"], ["record", "--help"], ["replay", "--help"]]
)
def test_help_at_every_level(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert sensor.main(words) == 0
    assert "usage" in capsys.readouterr().out
