"""Threads that die or stand still are an alarm and begun anew; nothing is called recorded that is not."""

import logging
import math
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace

import pytest

from gateway.wire.stop import Stopped
from server_gui.cli.collect import status_text
from server_gui.core.desk.recording import By, Recording, Tone
from server_gui.core.fleet.collector import Collector
from server_gui.core.fleet.live_prediction import _said
from server_gui.core.follow.news import News
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.settings.prediction import PredictionSettings
from server_gui.core.settings.server_file import (
    RecordingSettings,
    RobotSettings,
    ServerSettings,
    StoreSettings,
)
from server_gui.core.threads.supervision import STILL_S, ThreadWatch, Trouble, Worker
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S, until


def test_a_thread_that_dies_is_said_begun_anew_and_said_to_be_so(caplog: pytest.LogCaptureFixture) -> None:
    ending, began = threading.Event(), []

    def run() -> None:
        began.append(1)
        if len(began) == 1:
            raise SystemExit
        while not ending.wait(0.01):
            worker.beat()

    worker = Worker("recorder", run, WAIT_S)
    watch = ThreadWatch([worker])
    worker.start()
    until(lambda: watch.look() and len(began) == 2)
    (trouble,) = watch.look()
    assert trouble.works
    assert "stopped unexpectedly and was restarted (SystemExit; once so far); see the log" in trouble.text
    assert sum("was restarted" in record.getMessage() for record in caplog.records) == 1
    ending.set()
    assert worker.join(WAIT_S)
    assert watch.look() == ()


def test_a_thread_that_dies_again_and_again_does_not_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server_gui.core.threads.supervision.AGAIN_S", WAIT_S)
    worker = Worker("recorder", lambda: None)
    watch = ThreadWatch([worker])
    worker.start()
    until(lambda: any(not trouble.works for trouble in watch.look()))
    assert "2 times" in watch.look()[0].text
    worker.join()
    assert watch.look() == ()


def test_a_thread_that_waits_as_long_as_it_takes_does_not_stand_still_but_its_death_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ending = threading.Event()

    def run() -> None:
        ending.wait(WAIT_S)

    worker = Worker("stop keys", run, math.inf)
    watch = ThreadWatch(())
    watch.add(worker)
    worker.start()
    later = SimpleNamespace(monotonic=lambda: time.monotonic() + 1000 * STILL_S)
    monkeypatch.setattr("server_gui.core.threads.supervision.time", later)
    assert watch.look() == ()
    ending.set()  # it returns, though its owner has not asked for that
    until(watch.look)
    assert watch.look()[0].thread == "stop keys"
    worker.join()


def test_a_thread_that_stands_still_is_said_within_a_second_and_over_when_it_moves(
    caplog: pytest.LogCaptureFixture,
) -> None:
    go_on, ending = threading.Event(), threading.Event()

    def run() -> None:
        go_on.wait(WAIT_S)
        while not ending.wait(0.01):
            worker.beat()

    worker = Worker("recorder", run)
    watch = ThreadWatch([worker])
    worker.start()
    until(watch.look)
    assert STILL_S < 1.0
    assert watch.look() == (
        Trouble(
            "recorder",
            "the part “recorder” has not moved for more than 0.75 s; is this computer too busy?",
            False,
            is_late=True,
        ),
    )
    go_on.set()
    until(lambda: not watch.look())
    assert [r.levelno for r in caplog.records] == [logging.ERROR, logging.WARNING]
    ending.set()
    worker.join()


@pytest.fixture
def collector(tmp_path: Path, folder_url: str) -> Iterator[Collector]:
    with FakeRobot() as robot:
        settings = ServerSettings(
            {"exo-fake": RobotSettings(robot.address)},
            StoreSettings(folder_url),
            RecordingSettings(spool=tmp_path / "spool", batch_s=1.0, resources_s=0.1),
            PredictionSettings(enabled=True),
        )
        with Collector(settings) as collector:
            until(lambda: collector.report().result(WAIT_S).recorder.recorded > 5)
            yield collector


def troubles(collector: Collector) -> tuple[Trouble, ...]:
    """What the loop of the command, or of the window, sees."""
    collector.wait(0.01)
    return collector.watch.look()


def is_patient(collector: Collector, but: str = "") -> None:
    """On a busy computer any thread may stand still; only that of this name is to be told for it."""
    for worker in collector.watch._workers:
        if worker.name != but:
            worker._still_s = WAIT_S


def said(collector: Collector) -> tuple[Recording, str]:
    """What the window says, and what the status command says, of this collector."""
    recording = Recording(By.WINDOW, None, lambda call: call(), News())
    recording._keeper = collector
    recording.report = collector.report().result(WAIT_S)
    recording.see(collector.watch.look())
    return recording, status_text(recording.report)


@pytest.mark.parametrize("name", ["_recorder", "_uploader", "network"])
def test_a_dead_thread_of_a_collector_is_an_alarm_everywhere_and_works_again(
    collector: Collector, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    def die(*_: object, **__: object) -> None:
        monkeypatch.undo()
        raise SystemExit

    is_patient(collector)
    owner = getattr(collector, name)
    if name == "network":
        owner._loop.call_soon_threadsafe(die)
    else:
        monkeypatch.setattr(owner, {"_recorder": "_turn", "_uploader": "_empty"}[name], die)
    until(lambda: troubles(collector))
    recording, status = said(collector)
    assert (
        f"ALARM  the part “{owner.worker.name}” stopped unexpectedly and was restarted (SystemExit" in status
    )
    assert recording.said(None).tone is Tone.WARNING
    assert any(owner.worker.name in news.text for news in recording._news.items)
    before = collector.report().result(WAIT_S).recorder.recorded
    until(lambda: collector.report().result(WAIT_S).recorder.recorded > before)


LATE_S = "server_gui.core.threads.supervision.LATE_S"


@pytest.mark.parametrize(
    ("late_s", "told"),
    [(WAIT_S, (Tone.WARNING, "Recording is late")), (0.0, (Tone.BAD, "RECORDING HAS STOPPED"))],
)
def test_a_recorder_that_stands_still_is_not_said_to_record(
    collector: Collector, monkeypatch: pytest.MonkeyPatch, late_s: float, told: tuple[Tone, str]
) -> None:
    monkeypatch.setattr(LATE_S, late_s)
    is_patient(collector, but="recorder")
    go_on = threading.Event()
    monkeypatch.setattr(collector._spool, "append", lambda *_: go_on.wait(WAIT_S))
    until(lambda: troubles(collector))
    recording, status = said(collector)
    assert "ALARM  the part “recorder” has not moved" in status
    assert (recording.said(None).tone, recording.said(None).text) == told
    if late_s:
        assert "recording is late: this computer is busy" in [news.text for news in recording._news.items]
        assert [one.alarm.what for one in recording.alarms.active] == ["this computer is busy"]
    monkeypatch.undo()
    go_on.set()
    until(lambda: not troubles(collector))


def test_what_was_in_hand_when_the_recorder_died_is_counted_as_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def die(*_: object) -> None:
        monkeypatch.undo()
        raise SystemExit

    with Spool(tmp_path, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        watch = ThreadWatch([recorder.worker])
        monkeypatch.setattr(recorder, "_turn", die)
        recorder.mark("exo-01", "now")
        until(lambda: any("stopped unexpectedly" in trouble.text for trouble in watch.look()))
        assert recorder.flush(WAIT_S)
        assert recorder.state.lost == 1
        recorder.mark("exo-01", "again")
        assert recorder.flush(WAIT_S)
        assert recorder.state.recorded >= 1


def test_nobody_answering_is_not_called_recording() -> None:
    recording = Recording(By.WINDOW, None, lambda call: call(), News())
    recording._keeper = SimpleNamespace()
    recording._asking, recording._asked_ns = True, time.monotonic_ns() - 3_000_000_000
    assert recording.said(None).tone is Tone.BAD


def test_what_a_rules_stop_did_says_why_it_is_not_confirmed() -> None:
    answer: Future[Stopped] = Future()
    answer.set_result(Stopped({"knee": "confirmed"}, held=True, outdated="robot.toml: is broken"))
    assert _said(answer) == "knee confirmed, not confirmed: robot.toml: is broken"
