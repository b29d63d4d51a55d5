"""A robot that is recorded is predicted: what is said is kept, and comes again from the recording."""

import json
from collections import Counter
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from ml.store import Store, sessions
from ml.store.labels import Label, utc_ns
from ml.store.tables import LABELS, PREDICTIONS
from server_gui.cli import predict
from server_gui.cli.collect import status_text
from server_gui.core.fleet.collector import Collector, CollectorReport
from server_gui.core.prediction.replay import Live, replay
from server_gui.core.prediction.track_record import TrackRecord
from server_gui.core.settings.prediction import Action, PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import (
    RecordingSettings,
    RobotSettings,
    ServerSettings,
    StoreSettings,
)
from server_gui.terminal.predictions import replay_told
from tests.support import waiting
from tests.support.waiting import WAIT_S
from tests.unit.prediction.robots import SteadyRobot, promoters, publish

ENOUGH = 30  # decisions
WALKING = RuleSettings("activity", "walk", 0.8, for_ms=200, action=Action.STOP)


@pytest.fixture
def robot() -> Iterator[SteadyRobot]:
    with SteadyRobot() as robot:
        yield robot


@pytest.fixture
def server(robot: SteadyRobot, tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings(
        {"exo-fake": RobotSettings(robot.address)},
        StoreSettings(folder_url),
        RecordingSettings(spool=tmp_path / "spool", batch_s=1.0),
        PredictionSettings(poll_s=1.0),
        (WALKING,),
        promoters("anna"),
    )


def until(collector: Collector, condition: Callable[[CollectorReport], object]) -> CollectorReport:
    def found() -> CollectorReport | None:
        return report if condition(report := collector.report().result(WAIT_S)) else None

    return waiting.until(found, collector.report, step=lambda: collector.wait(0.05))


def judged(report: CollectorReport) -> int:
    return 0 if report.prediction is None else report.prediction.judged


def says(report: CollectorReport) -> str | None:
    """What was said last."""
    robots = {} if report.prediction is None else report.prediction.robots
    newest = robots.get("exo-fake", {}).get("activity")
    return None if newest is None else newest.label


def test_what_is_predicted_is_kept_with_the_recording_and_comes_again_from_it(
    server: ServerSettings, robot: SteadyRobot, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = publish(server.store.url, by="anna")
    with Collector(server) as collector:
        report = until(
            collector,
            lambda report: judged(report) >= ENOUGH and robot.called("robot.stop") and says(report) == "walk",
        )
        told = msgspec.json.decode(msgspec.json.encode(report), type=CollectorReport)
    assert "activity  walk" in status_text(told)
    assert model in status_text(told)

    store = Store(server.store.url)
    (session,) = sessions.sessions(store)
    rows = sessions.rows_of(store, session, PREDICTIONS)
    assert len(rows) >= ENOUGH
    assert {(row["model"], row["task"]) for row in rows} == {(model, "activity")}
    assert Counter(row["label"] for row in rows).most_common(1)[0][0] == "walk"

    # the rule has stopped it, and the recording says so and when
    stop = robot.called("robot.stop")[0]
    assert stop["reason"].startswith(f"rule {WALKING.name} (stop) holds: walk")
    events = {
        row["text"].partition(" ")[0]: row
        for row in sessions.rows_of(store, session)
        if row["kind"] == "rule"
    }
    assert events.keys() == {"rule", "stop"}
    assert "left_knee confirmed" in events["stop"]["text"]
    assert json.loads(events["stop"]["data"])["after_ms"] > 0

    # again, over the recording
    config = tmp_path / "server.toml"
    config.write_text(f'[store]\nurl = "{server.store.url}"\n')
    assert predict.main(["--session", session.session, "--config", str(config), "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    again = {line["stamp_ns"]: line for line in lines if "stamp_ns" in line}
    for row in rows:
        line = again[row["stamp_ns"]]
        assert (line["label"], line["probability"]) == (row["label"], row["probability"])
        assert line["probabilities"] == json.loads(row["probabilities"])
    assert lines[-1]["live"] == {"decisions": len(rows), "same": len(rows)}
    assert lines[-1]["quality"] is None
    assert predict.main(["--session", session.session, "--config", str(config)]) == 0
    assert f"said live: {len(rows)}, of which {len(rows)} are the same here" in capsys.readouterr().out

    # what labels say of it is the same live and over the recording
    begin, end = (row["utc"] - timedelta(milliseconds=250) for row in (rows[5], rows[-5]))
    label = Label("exo-fake", session.session, utc_ns(begin), utc_ns(end), "walk", "ada")
    data = LABELS.rows([label.row(utc_ns(end))])
    store.append(LABELS, "labels", data.schema, data.to_reader, "ada", 1)
    assert predict.main(["--session", session.session, "--config", str(config), "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    live = {row["stamp_ns"] for row in rows}
    own = Counter(line["label"] for line in lines if "truth" in line and line["stamp_ns"] in live)
    assert own.total() == len(rows) - 10
    figures = TrackRecord(store.url).figures({"exo-fake"}, datetime.now(UTC))
    assert figures["exo-fake"]["activity"][model].confusion == {"walk": own}
    assert lines[-1]["quality"]["confusion"].keys() == {"walk"}

    # more has been said, and kept, since the recording was read: no difference where it goes on
    late = PREDICTIONS.rows([rows[-1] | {"utc": utc_ns(end), "stamp_ns": rows[-1]["stamp_ns"] + 10**10}])
    store.append(PREDICTIONS, "predictions", late.schema, late.to_reader, "late", 1)
    for one, said in ((replace(session, ended=None), len(rows)), (session, len(rows) + 1)):
        assert replay(store, one, PredictionSettings())[0].live == Live(said, len(rows))

    # a model that has learned from this session is not proven right by it
    pupil = publish(server.store.url, learned=(session.session,))
    mine, other = replay(store, session, PredictionSettings(), [pupil, model])
    assert (mine.flattered, other.flattered) == (True, False)
    assert mine.quality == other.quality
    assert f"labels: {mine.quality.text if mine.quality else None}; the model has learned" in replay_told(
        mine
    )
