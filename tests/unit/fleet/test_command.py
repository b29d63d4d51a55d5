"""`gwrms collect` as a command: what it refuses, what it says, and that it needs no window."""

import contextlib
import gc
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from gateway import main
from gateway.client import Address
from server_gui.cli.collect import status_text
from server_gui.core.fleet.collector import CollectorReport
from server_gui.core.fleet.link_statistics import LinkStatistics
from server_gui.core.prediction.state import DangerReport, PredictingState, Quality
from server_gui.core.recording.recorder import Alarm, AlarmKind, RecorderState
from server_gui.core.recording.uploader import UploaderState
from server_gui.core.settings.server_file import Upload
from server_gui.processes.shutdown_signals import ShutdownRequested

ENOUGH, ONE_WALK = (Quality(312, 292, 1, 19, {}, seconds=312, recordings=count) for count in (3, 1))
HEAVY = ("PySide6", "pyqtgraph", "sklearn", "duckdb")


@pytest.fixture(autouse=True)
def own_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--robot", "exo-01"], "'exo-01' is not NAME=HOST:PORT"),
        (["--status", "--upload"], "not allowed with"),
        (["now"], "unrecognized arguments"),
    ],
)
def test_wrong_usage_is_2(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main.main(["collect", *arguments])
    assert ended.value.code == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "no robot is named: write it into [robots] of"),
        (["--robot", "a=:1", "--robot", "b=:1"], "[robots] b: 127.0.0.1:1 is a already"),
        (["--config", "nowhere.toml"], "nowhere.toml: is not there"),
        (["--status"], "no collector runs on the spool"),
        (["--upload"], "no collector runs on the spool"),
    ],
)
def test_what_cannot_be_done_is_a_sentence_and_1(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.main(["collect", *arguments]) == 1
    said = capsys.readouterr()
    assert words in said.err
    assert said.out == ""


def test_nothing_that_a_window_needs_is_imported() -> None:
    script = f"import sys, server_gui.cli.collect; print([n for n in {HEAVY} if n in sys.modules])"
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_the_unit_is_for_this_installation(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["collect", "--unit"]) == 0
    unit = capsys.readouterr().out
    assert f"ExecStart={sys.executable} -P -m gateway.main collect --config" in unit
    assert "@PYTHON@" not in unit
    assert "ProtectSystem=strict" in unit


def test_a_status_says_what_people_ask_first() -> None:
    alarm = Alarm(AlarmKind.DISK_FULL, "recording has stopped: the disk of /spool is nearly full")
    report = CollectorReport(
        version="1.0",
        pid=5,
        began_utc_s=1.0,
        spool="/spool",
        store="s3://bucket/prefix",
        upload=Upload.IDLE,
        disk_free_bytes=3 << 30,
        robots={"exo-01": LinkStatistics(Address("192.0.2.7")).report("")},
        recorder=RecorderState(12, 3, 4, 0.01, (alarm,)),
        uploader=UploaderState(2, 7, 5 << 20, 0.5, "no network", ("/spool/00000003.damaged.db",)),
        prediction=PredictingState(
            dangers={"exo-01": DangerReport("none, 0.04", time.time() - 3600.0)},
            labelled={"exo-01": {"activity": {"enough": ENOUGH, "little": ONE_WALK}}},
        ),
    )
    text = status_text(report)
    rows = {line.split()[2]: line.split()[3:] for line in text.splitlines() if " activity " in line}
    assert rows["enough"] == ["5", "min", "3", "93.6", "%", "0.3", "%", "6.1", "%"]
    assert rows["little"] == ["5", "min", "1", "too", "little", "–", "–"], "of one walk"
    for words in (
        "12 rows",
        "4 lost",
        "ALARM  recording has stopped",
        "ALARM  no network",
        "2 batches uploaded, 7 wait (upload = idle)",
        "ALARM  /spool/00000003.damaged.db is damaged: what is damaged of it is not in the store",
        "5.0 MiB",
        "192.0.2.7:7420",
        "exo-01: the link is idle",
        "exo-01: danger, 3600 s ago: none, 0.04",
    ):
        assert words in text


@pytest.mark.parametrize(("untold", "status"), [(0, 0), (7, 1)])
def test_rows_that_are_lost_and_no_event_tells_are_in_the_exit_status(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    untold: int,
    status: int,
) -> None:
    class Lossy(contextlib.AbstractContextManager["Lossy"]):
        hangs = False

        def __init__(self, *_: object, **_named: object) -> None:
            self.untold = untold

        def __exit__(self, *_: object) -> None:
            pass

        def wait(self, _within_s: float) -> None:
            raise ShutdownRequested(signal.SIGTERM)

    monkeypatch.setattr("server_gui.cli.collect.Collector", Lossy)
    monkeypatch.setattr("server_gui.cli.collect._log_to_stderr", lambda: None)
    monkeypatch.setattr(gc, "freeze", lambda: None)
    file = tmp_path / "server.toml"
    file.write_text(f'[recorder]\nspool = "{tmp_path / "spool"}"\n')
    assert main.main(["collect", "--config", str(file), "--robot", "exo-01=127.0.0.1:1"]) == status
    assert ("7 rows are lost, and no event tells of them" in caplog.text) == bool(status)
