"""Prediction beside the recording: what serves is used at once, what breaks ends alone, nobody waits."""

import dataclasses
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.registry.pointers import Pointers
from ml.registry.registry import Registry
from ml.serving.predictor import Prediction, Window, judged, replayed
from ml.store import Store, StoreUnreachable
from ml.store.objects import Objects
from server_gui.core.prediction import inbox, robot_predictor
from server_gui.core.prediction import service as module
from server_gui.core.prediction.news import Serves
from server_gui.core.prediction.service import PredictionService
from server_gui.core.prediction.state import Quality
from server_gui.core.prediction.track_record import TrackRecord
from tests.support.waiting import WAIT_S
from tests.unit.ml.serving.small import MS, STEP_MS, Floats, hips, learned
from tests.unit.prediction.lab import Lab
from tests.unit.prediction.robots import (
    ROBOT,
    card,
    described,
    predicting,
    publish,
    served,
    settings,
    telemetry,
    walking,
)

EVERY_NS = 100 * MS


@pytest.fixture(autouse=True)
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests send at once what robots send in seconds: nothing of that is late, or too much to wait."""
    monkeypatch.setattr(robot_predictor, "LATE_NS", 3_600_000 * MS)
    monkeypatch.setattr(inbox, "MOST_NS", 3_600_000 * MS)


def send(to: PredictionService, rows: Floats, robot: str = ROBOT, begin_ns: int = 0) -> None:
    for event in telemetry(rows, begin_ns):
        to.take(robot, event)


def expected(model: str, rows: Floats, begin_ns: int = 0) -> list[Prediction]:
    stamps = begin_ns + np.arange(len(rows)) * STEP_MS * MS
    return replayed(model, learned(), stamps, rows, EVERY_NS)


def test_what_is_said_live_is_what_the_recording_gives(folder_url: str) -> None:
    name = publish(folder_url)
    rows = np.concatenate([hips(3, walks=False), hips(3, walks=True)])
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        wanted = expected(name, rows)
        send(one, rows)
        told.until(lambda: len(told.predicted()) >= len(wanted))
        state = one.state
    assert [news.prediction for news in told.predicted()] == wanted
    newest = told.predicted()[-1]
    assert (newest.card.id, newest.prediction.label) == (name, "walk")
    report = state.robots[ROBOT]["activity"]
    assert (report.model, report.label, state.judged, state.skipped) == (name, "walk", len(wanted), 0)
    assert not state.problems


def test_sources_that_come_one_by_one_give_what_rows_of_all_give(folder_url: str) -> None:
    """With `rate_hz = 0` each notification has one component's channels alone."""
    name = publish(folder_url)
    rows = hips(3, walks=True)
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        for event in telemetry(rows):
            for channel, column in event.batch.columns.items():
                alone = dataclasses.replace(event.batch, columns={channel: column})
                one.take(ROBOT, dataclasses.replace(event, batch=alone))
            one.take(ROBOT, dataclasses.replace(event, batch=dataclasses.replace(event.batch, columns={})))
        told.until(lambda: len(told.predicted()) >= len(expected(name, rows)))
    assert [news.prediction for news in told.predicted()] == expected(name, rows)


def test_a_promoted_model_serves_without_a_restart_and_so_does_the_old_one_after_a_rollback(
    folder_url: str,
) -> None:
    first = publish(folder_url)
    sent = walking()
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)

        def until_serves(name: str) -> None:
            told.until(
                lambda: told.predicted() and told.predicted()[-1].prediction.model == name,
                lambda: one.take(ROBOT, next(sent)),
            )

        until_serves(first)
        second = publish(folder_url, notes="another")
        until_serves(second)
        Registry(folder_url).rollback("activity", who="tester")
        until_serves(first)
    points = [news.prediction.stamp_ns for news in told.predicted()]
    assert set(np.diff(points)) == {EVERY_NS}  # the change has cost no decision


def test_a_robot_has_its_own_model_before_that_of_all(folder_url: str) -> None:
    everyones = publish(folder_url)
    own = publish(folder_url, robot="exo-02", notes="another")
    rows = hips(3, walks=True)
    with predicting(settings(folder_url)) as (one, told):
        for robot in (ROBOT, "exo-02"):
            served(one, told, robot)
            send(one, rows, robot)
        told.until(lambda: told.predicted() and told.predicted("exo-02"))
    assert {news.prediction.model for news in told.predicted()} == {everyones}
    assert {news.prediction.model for news in told.predicted("exo-02")} == {own}


def test_a_model_of_other_units_serves_nobody_and_says_why(folder_url: str) -> None:
    publish(folder_url)
    with predicting(settings(folder_url)) as (one, told):
        one.take(ROBOT, described(unit="°"))
        told.until(lambda: one.state.problems)
        problems = one.state.problems
        send(one, hips(3, walks=True))
    assert not told.predicted()
    assert len(problems) == 1
    assert problems[0].startswith(f"{ROBOT}: activity: ")
    assert "in rad, and exo-01 gives it in °" in problems[0]


def test_a_damaged_model_changes_nothing_and_is_said(folder_url: str) -> None:
    first = publish(folder_url)
    sent = walking()
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        second = Registry(folder_url).publish(learned().state(), card(learned(), notes="another"))
        file = Path(folder_url.removeprefix("file://")) / "models" / second / "model.skops"
        file.write_bytes(b"\x80 a pickle, perhaps")
        Pointers(Objects(folder_url), "activity").promote(second, "tester", "a test")
        told.until(lambda: one.state.problems and told.predicted(), lambda: one.take(ROBOT, next(sent)))
        problem = one.state.problems[0]
    assert second in problem
    assert "SHA-256" in problem
    assert {news.prediction.model for news in told.predicted()} == {first}


def test_a_model_that_breaks_ends_nothing_but_itself(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    bad = publish(folder_url, robot="exo-02")
    good = publish(folder_url, notes="another")

    def breaks(model: str, *rest: Any) -> list[Prediction]:
        if model == bad:
            raise FloatingPointError("a mistake")
        return judged(model, *rest)

    monkeypatch.setattr(module, "judged", breaks)
    with predicting(settings(folder_url)) as (one, told):
        for robot in (ROBOT, "exo-02"):
            served(one, told, robot)
            send(one, hips(3, walks=True), robot)
        told.until(lambda: one.state.problems and told.predicted())
        state = one.state
    assert state.problems == (f"{bad}: it cannot be used: internal error, FloatingPointError",)
    assert not told.predicted("exo-02")
    assert {news.prediction.model for news in told.predicted()} == {good}


def test_who_falls_behind_decides_about_the_newest_and_counts_what_was_skipped(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = publish(folder_url)
    busy, go_on = threading.Event(), threading.Event()

    def slow(model: str, known: Any, windows: Sequence[Window]) -> list[Prediction]:
        busy.set()
        go_on.wait()
        return judged(model, known, windows)

    monkeypatch.setattr(module, "judged", slow)
    monkeypatch.setattr(robot_predictor, "LATE_NS", 500 * MS)
    rows = hips(9, walks=True)
    with predicting(settings(folder_url)) as (one, told):
        try:
            served(one, told)
            send(one, rows[:300])
            assert busy.wait(WAIT_S)
            send(one, rows[300:], begin_ns=3_000 * MS)
        finally:
            go_on.set()
        told.until(lambda: told.predicted() and told.predicted()[-1].prediction.stamp_ns >= 8_900 * MS)
        skipped = one.state.skipped
    wanted = expected(name, rows)
    found = [news.prediction for news in told.predicted()]
    assert found == [one for one in wanted if one in found]
    assert len(found) + skipped == len(wanted)
    late = [one for one in found if 3_000 * MS < one.stamp_ns < 8_400 * MS]
    assert not late


def test_a_robot_that_has_booted_begins_anew(folder_url: str) -> None:
    name = publish(folder_url)
    rows = hips(3, walks=True)
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        send(one, rows, begin_ns=10**15)
        one.take(ROBOT, described("boot-2"))
        send(one, rows)
        told.until(lambda: len(told.predicted()) == 2 * len(expected(name, rows)))
    assert [news.prediction for news in told.predicted()] == [
        *expected(name, rows, 10**15),
        *expected(name, rows),
    ]


def test_what_a_robot_sends_wrongly_disturbs_no_other(folder_url: str) -> None:
    publish(folder_url)
    rows = hips(3, walks=True)
    with predicting(settings(folder_url)) as (one, told):
        for robot in (ROBOT, "exo-02"):
            served(one, told, robot)
        for event in telemetry(rows):
            del event.batch.columns["left_hip.position"][3:]
            one.take(ROBOT, event)
        send(one, rows, "exo-02")
        told.until(lambda: told.predicted("exo-02"))
    assert not told.predicted()


def test_without_a_model_nothing_is_said(folder_url: str) -> None:
    with predicting(settings(folder_url)) as (one, told):
        one.take(ROBOT, described())
        send(one, hips(3, walks=True))
        told.until(lambda: told.news, lambda: one.take(ROBOT, described()))
        assert not one.state.problems
    assert not told.predicted()
    (serves,) = told.news
    assert isinstance(serves, Serves)
    assert not serves.models
    assert serves.why == {
        **{
            task: f"no model serves {task}: gwrms train {task} --promote, or gwrms models promote MODEL"
            for task in ("activity", "gait_phase")
        },
        "falling": "falling cannot be told from this robot's channels",
    }


def test_what_labels_say_of_the_model_is_told_with_its_predictions(folder_url: str) -> None:
    lab = Lab(folder_url, time.time_ns() - 3600 * 10**9)
    lab.say(["walk", "walk", "unknown"])
    lab.label("walk", -1000, 1000)
    sent = walking()
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        told.until(
            lambda: told.predicted() and told.predicted()[-1].quality, lambda: one.take(ROBOT, next(sent))
        )
        state = one.state
    quality = Quality(3, 2, 0, 1, {"walk": {"unknown": 1, "walk": 2}}, seconds=1, recordings=1)
    assert told.predicted()[-1].quality == quality
    assert state.labelled == {ROBOT: {"activity": {lab.model: quality}}}
    assert not state.problems


def test_labels_that_cannot_be_read_are_a_problem_and_prediction_goes_on(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unreachable(*_: object) -> None:
        raise StoreUnreachable("the store does not answer")

    Store(folder_url)
    publish(folder_url)
    monkeypatch.setattr(TrackRecord, "figures", unreachable)
    sent = walking()
    with predicting(settings(folder_url)) as (one, told):
        served(one, told)
        told.until(lambda: told.predicted() and one.state.problems, lambda: one.take(ROBOT, next(sent)))
        state = one.state
    assert state.problems == ("predictions are not compared with labels: the store does not answer",)
    assert state.labelled is None
