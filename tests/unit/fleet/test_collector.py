"""The collector as a whole: it records, answers, uploads when it may, and ends in bounded time."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from gateway.client import Address
from gateway.main import main
from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.fleet import collector as module
from server_gui.core.fleet.collector import Collector, CollectorReport
from server_gui.core.fleet.control_socket import NobodyCollects, ask
from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.spool import Spool
from server_gui.core.settings.server_file import (
    RecordingSettings,
    RobotSettings,
    ServerSettings,
    StoreSettings,
    Upload,
)
from tests.fake_robot import FakeRobot
from tests.support import waiting
from tests.support.waiting import WAIT_S


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


@pytest.fixture
def settings(robot: FakeRobot, tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings(
        {"exo-fake": RobotSettings(robot.address)},
        StoreSettings(folder_url),
        RecordingSettings(spool=tmp_path / "spool", batch_s=1.0, resources_s=0.1),
    )


def upload(settings: ServerSettings, when: Upload) -> ServerSettings:
    return msgspec.structs.replace(settings, recorder=msgspec.structs.replace(settings.recorder, upload=when))


def report(settings: ServerSettings) -> CollectorReport:
    return msgspec.json.decode(ask(settings.recorder.spool, "status"), type=CollectorReport)


def until(collector: Collector, condition: Callable[[], object]) -> None:
    waiting.until(condition, collector.report, step=lambda: collector.wait(0.01))


def answers(settings: ServerSettings) -> bool:
    try:
        return bool(ask(settings.recorder.spool, "status"))
    except NobodyCollects:
        return False


def rows(settings: ServerSettings) -> int:
    return report(settings).robots["exo-fake"].rows


def test_what_was_recorded_is_in_the_store_when_it_has_ended(settings: ServerSettings) -> None:
    with Collector(settings, "Ada", "a try") as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: rows(settings) > 20)
        told = report(settings)
    assert not collector.hangs
    store = Store(settings.store.url)
    assert store.dataset(TELEMETRY.location("exo-fake", 1)).count_rows() >= told.robots["exo-fake"].rows
    assert store.dataset("sessions").to_table(columns=["operator"])["operator"].to_pylist()[-1] == "Ada"
    assert store.dataset("resources").count_rows() > 0
    assert (told.recorder.lost, told.uploader.problem, told.upload) == (0, None, Upload.ALWAYS)
    with Spool(settings.recorder.spool) as spool:
        assert spool.waiting() == []


def test_a_mark_is_in_the_recording(settings: ServerSettings) -> None:
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: rows(settings) > 1)
        assert ask(settings.recorder.spool, "mark", "stairs") == b"1\n"
    events = (
        Store(settings.store.url).dataset("events").to_table(columns=["robot", "kind", "text"]).to_pylist()
    )
    assert {"robot": "exo-fake", "kind": "marker", "text": "stairs"} in events


def test_a_mark_that_cannot_be_kept_is_none(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=0))
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: collector.report().result(WAIT_S).recorder.alarms)
        assert ask(settings.recorder.spool, "mark", "stairs") == b"0\n"
        config = settings.recorder.spool.parent / "server.toml"
        config.write_text(f'[recorder]\nspool = "{settings.recorder.spool}"\n')
        assert main(["collect", "--config", str(config), "--mark", "stairs"]) == 1
    assert "not marked: nothing is being recorded" in capsys.readouterr().err


def test_a_robot_that_joins_later_is_recorded_marked_and_shown(settings: ServerSettings) -> None:
    shown: list[str] = []
    with (
        FakeRobot() as other,
        Collector(settings, subscribers=[lambda robot, _: shown.append(robot)]) as collector,
    ):
        collector.follow("exo-other", Address.parse(other.address)).result(WAIT_S)
        until(
            collector,
            lambda: min(one.rows for one in collector.report().result(WAIT_S).robots.values()) > 5,
        )
        assert collector.mark("stairs").result(WAIT_S) == 2
        assert collector.mark("before it began", 3600.0).result(WAIT_S) == 0
        for member in collector._fleet._members.values():  # as if they were recorded for long
            member.keeping.began_s = time.time() - 1000.0
        assert collector.mark("earlier", 60.0).result(WAIT_S) == 2
        note = '{"text": "at the door", "ago_s": 30.0}'
        assert ask(settings.recorder.spool, "note", note) == b"2\n"
    assert set(shown) == {"exo-fake", "exo-other"}
    columns = ["robot", "text", "utc"]
    events = Store(settings.store.url).dataset("events").to_table(columns=columns).to_pylist()
    at = {event["text"]: event["utc"] for event in events if event["robot"] == "exo-other"}
    for text, before_s in (("earlier", 60.0), ("at the door", 30.0)):
        assert before_s - WAIT_S < (at["stairs"] - at[text]).total_seconds() < before_s + WAIT_S


def test_uploading_now_takes_what_came_this_second(settings: ServerSettings) -> None:
    recorder = msgspec.structs.replace(settings.recorder, batch_s=3600.0)
    settings = upload(msgspec.structs.replace(settings, recorder=recorder), Upload.MANUAL)
    with Collector(settings) as collector:
        until(collector, lambda: collector.report().result(WAIT_S).robots["exo-fake"].rows > 20)
        collector.upload().result(WAIT_S)
        until(collector, lambda: collector.report().result(WAIT_S).uploader.uploaded == 1)
        assert collector.report().result(WAIT_S).disk_free_bytes > 0
    assert Store(settings.store.url).dataset(TELEMETRY.location("exo-fake", 1)).count_rows() > 20


def test_a_second_collector_on_one_spool_is_refused(settings: ServerSettings) -> None:
    with (
        Collector(settings),
        pytest.raises(SpoolUnusable, match=r"another server records into .* end it first"),
    ):
        Collector(settings)


def test_by_hand_means_when_somebody_asks(settings: ServerSettings) -> None:
    settings = upload(settings, Upload.MANUAL)
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: report(settings).uploader.waiting)
        assert report(settings).uploader.uploaded == 0
        assert int(ask(settings.recorder.spool, "upload")) >= 1
        until(collector, lambda: report(settings).uploader.uploaded)
    with Spool(settings.recorder.spool) as spool:
        assert spool.waiting()  # the last batch waits for somebody too


def test_idle_means_while_no_robot_sends(
    settings: ServerSettings, robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "QUIET_S", 3600.0)
    settings = upload(settings, Upload.IDLE)
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: report(settings).uploader.waiting)
        assert not collector._wanted()
        robot.frozen = True
        monkeypatch.setattr(module, "QUIET_S", 0.2)
        until(collector, lambda: report(settings).uploader.uploaded)


def test_idle_does_not_wait_for_ever(settings: ServerSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_BACKLOG_BYTES", 0)
    settings = upload(settings, Upload.IDLE)
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: report(settings).uploader.uploaded)


def test_an_upload_that_hangs_does_not_keep_it_from_ending(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    hanging, let_go = threading.Event(), threading.Event()

    def connect(store: StoreSettings) -> Store:
        hanging.set()
        let_go.wait(WAIT_S)
        return Store(store.url)

    monkeypatch.setattr(module, "connect", connect)
    monkeypatch.setattr(module, "LAST_UPLOAD_S", 0.1)
    monkeypatch.setattr(module, "BREAK_OFF_S", 0.1)
    with Collector(settings) as collector:
        until(collector, hanging.is_set)
    assert collector.hangs
    let_go.set()
    assert collector._uploader.close(WAIT_S)
    with Spool(settings.recorder.spool) as spool:
        assert spool.waiting()


def test_a_robot_that_is_off_keeps_nothing_from_working(settings: ServerSettings, robot: FakeRobot) -> None:
    robots = {**settings.robots, "exo-off": RobotSettings("127.0.0.1:1")}
    settings = msgspec.structs.replace(settings, robots=robots)
    with Collector(settings) as collector:
        until(collector, lambda: answers(settings))
        until(collector, lambda: rows(settings) > 5)
        until(collector, lambda: report(settings).robots["exo-off"].problem)
        assert "no gateway at 127.0.0.1:1" in str(report(settings).robots["exo-off"].problem)
