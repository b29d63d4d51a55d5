"""Danger of a robot, live: off unless asked for, and what nobody can say is unknown, never fine."""

import math
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest
from msgspec.structs import replace

from gateway.client import Batch
from ml.danger.calibration import SHIPPED, Calibration, load
from ml.danger.levels import Level
from ml.danger.observation import CHANNELS
from ml.errors import UnusableModel
from server_gui.core.follow.events import Telemetry
from server_gui.core.prediction import service as module
from server_gui.core.prediction.danger import EVERY_NS, prediction
from server_gui.core.prediction.newest_predictions import STALE_S, StationPredictions
from server_gui.core.prediction.news import Endangered
from server_gui.core.prediction.robot_predictor import RobotPredictor
from server_gui.core.prediction.rules import PredictionRule
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import ServerSettings
from tests.unit.ml.serving.small import MS, hips
from tests.unit.prediction.endangered import endangered
from tests.unit.prediction.robots import ROBOT, described, predicting, settings, telemetry

CALIBRATION = load()
SELDOM_NS = 140 * MS  # as seldom as can be: it is learned from seconds, not from rows
LEARNED = 300  # rows, after which a temperature's usual is known
KNEE = "left_knee.temperature"


def rows(count: int, at: int = 0, **columns: float | None) -> Telemetry:
    """A batch from row `at` on, in which each channel keeps its value."""
    stamps = [(at + row) * SELDOM_NS for row in range(count)]
    held = {name.replace("__", "."): [value] * count for name, value in columns.items()}
    return Telemetry(1, Batch(stamps, held, at, 0, 0, 1, stamps[-1]), None)


def foreseen(robot: RobotPredictor, *events: Telemetry) -> list[Endangered]:
    robot.take(events)
    news, robot.danger_news = robot.danger_news, []
    return [one for one in news if isinstance(one, Endangered)]


@pytest.fixture
def robot() -> RobotPredictor:
    return RobotPredictor(ROBOT, PredictionSettings(danger=True), (), CALIBRATION)


@pytest.fixture
def known(robot: RobotPredictor) -> RobotPredictor:
    """A robot whose knee has been at 30 °C for as long as it takes to learn that."""
    assert foreseen(robot, rows(LEARNED, left_knee__temperature=30.0))[-1].verdict.number is not None
    return robot


def is_unknown(said: Sequence[Endangered]) -> bool:
    return bool(said) and {one.verdict.level for one in said} == {Level.UNKNOWN}


def test_it_is_off_unless_the_server_s_file_asks_for_it() -> None:
    assert not ServerSettings().prediction.danger
    assert not foreseen(RobotPredictor(ROBOT, PredictionSettings(), ()), rows(5, left_knee__temperature=30.0))


def test_the_service_says_unknown_of_a_robot_without_the_channels(folder_url: str) -> None:
    server = settings(folder_url)
    server = replace(server, prediction=replace(server.prediction, danger=True))
    with predicting(server) as (one, told):
        one.take(ROBOT, described())
        for event in telemetry(hips(1, walks=True)):
            one.take(ROBOT, event)
        told.until(lambda: any(isinstance(news, Endangered) for news in told.news))
        assert not one.state.problems
        first = next(news for news in told.news if isinstance(news, Endangered))
        report = one.state.dangers[ROBOT]
        assert report.text == first.text
        assert report.utc_s >= first.utc_ns / 1e9, "the status tells its age"
    said = [news for news in told.news if isinstance(news, Endangered)]
    assert is_unknown(said)
    assert said[0].text.startswith("unknown: its detectors lack data, or learn what is usual")


def test_a_calibration_that_cannot_be_used_is_a_problem_and_foresees_nothing(
    folder_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused() -> Calibration:
        raise UnusableModel("it is damaged")

    monkeypatch.setattr(module, "load", refused)
    server = settings(folder_url)
    with predicting(replace(server, prediction=replace(server.prediction, danger=True))) as (one, told):
        told.until(lambda: one.state.problems)
        assert one.state.problems == ("danger is not foreseen: it is damaged",)
    assert not told.news


@pytest.mark.parametrize("value", [None, math.nan, math.inf, -math.inf])
def test_what_is_no_number_is_missing(robot: RobotPredictor, value: float | None) -> None:
    columns = {name.replace(".", "__"): value for name in CHANNELS}
    said = foreseen(robot, rows(40, 0, **columns))
    assert is_unknown(said)
    assert {one.verdict.number for one in said} == {None}


def test_channels_that_nobody_knows_change_nothing(robot: RobotPredictor) -> None:
    assert is_unknown(foreseen(robot, rows(40, third_knee__temperature=400.0, battery__voltage=1.0)))


def test_a_value_that_has_stopped_coming_is_held_for_a_moment_and_then_unknown(known: RobotPredictor) -> None:
    (said, *_) = foreseen(known, rows(10, LEARNED + 5, left_knee__temperature=None))
    assert is_unknown([said])
    assert said.verdict.number is None


def test_a_robot_that_has_booted_is_another_one_until_it_is_known(known: RobotPredictor) -> None:
    known.take([described("boot-1"), described("boot-2")])
    said = foreseen(known, rows(5, left_knee__temperature=30.0))
    assert is_unknown(said)
    assert said[-1].verdict.number is None


def test_of_a_dead_robot_the_last_word_is_not_known_any_more() -> None:
    known = StationPredictions(foresees=True)
    known.take(endangered(Level.NONE))
    shown = known.danger
    assert shown is not None
    assert shown.is_known
    assert shown.is_stale(shown.came_ns + round(STALE_S * 1e9))
    known.clear()  # the link has dropped
    assert known.danger is None


def test_what_was_known_last_stays_while_nobody_knows_better() -> None:
    known = StationPredictions()
    found: list[tuple[bool, Level | None]] = []
    for level in (Level.ALARM, Level.UNKNOWN, Level.NONE):
        known.take(endangered(level))
        assert known.danger is not None
        before = known.danger.known
        found.append((known.danger.is_known, None if before is None else before.level))
    assert found == [(True, Level.ALARM), (False, Level.ALARM), (True, Level.NONE)]


def test_no_rule_begins_to_hold_by_what_is_unknown() -> None:
    rule = PredictionRule(RuleSettings("danger", "alarm", 0.5), EVERY_NS)
    assert rule.take(prediction(endangered(Level.UNKNOWN, 0.99).verdict)) is None
    assert rule.take(prediction(endangered(Level.ALARM, 0.99).verdict)) is True


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"detectors": ("drift",) * 8}, "it is of the detectors drift"),
        ({"floor": (1.0,) * 8}, "a floor and a scale of each detector"),
        ({"weights": (1.0,) * 8}, "the two weights of the worst"),
        ({"weights": (-1.0,) * 2}, "negative"),
        ({"scale": (0.0,) * len(CALIBRATION.scale)}, "not above 0"),
        ({"odds": ()}, "how often"),
        ({"thresholds": {"alarm": 1.0}}, "no threshold of early warning, advice, stop"),
        ({"thresholds": {**CALIBRATION.thresholds, "stop": -9.0}}, "lower threshold"),
        ({"bias": -CALIBRATION.bias}, "it is damaged"),
        ({"odds": CALIBRATION.odds[::-1]}, "it is damaged"),
    ],
)
def test_a_calibration_of_something_else_is_refused(
    changes: dict[str, object], why: str, tmp_path: Path
) -> None:
    file = tmp_path / "calibration.json"
    file.write_bytes(msgspec.json.encode(msgspec.to_builtins(CALIBRATION) | changes))
    with pytest.raises(UnusableModel, match=why):
        load(file)


def test_a_damaged_calibration_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    whole = SHIPPED.read_bytes()
    for damaged in (whole[:200], whole.replace(b"drift", b"dr\xe9ft")):
        file.write_bytes(damaged)
        with pytest.raises(UnusableModel, match="cannot be read"):
            load(file)
    file.write_bytes(msgspec.json.encode(CALIBRATION))
    assert load(file) == CALIBRATION
