"""What models say is shown with how sure, by which model, how far to believe it, and when it is not known."""

import dataclasses
import re
import time
from collections.abc import Callable, Iterator

import msgspec
import pytest
from PySide6.QtWidgets import QPushButton, QVBoxLayout, QWidget

from gateway.client import ConnectionState
from ml.registry.card import DataSource
from ml.serving.trust import Trust
from server_gui.core.desk.leg_phase import leg_phase
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import LinkChanged
from server_gui.core.prediction.newest_predictions import OFF, NewestPrediction, Recalled
from server_gui.core.prediction.news import Ruled, Serves
from server_gui.core.prediction.state import Quality
from server_gui.core.processing.gait_events import EventSource, Leg
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.views.frame.header import Header
from server_gui.views.marks import Mark
from server_gui.views.overview.page import Overview
from server_gui.views.predictions import (
    NOT_NAMED,
    PredictionRow,
    activity,
    doing,
    instead_of_insoles,
    lines,
    model_phases,
    most_needed,
    status,
    step_phases,
)
from server_gui.views.theme import Theme
from tests.gui.fakes import Bench, destroy
from tests.gui.foreseen import predicted
from tests.gui.running import wait
from tests.support.desk import JOINTS, looked, telemetry, walking

HOUR_S = 3600.0
UNCHECKED = "not yet checked on this robot, learned in the simulator 3 days ago"
WALKS = {"walk": 0.94, "turn": 0.04, "stand": 0.02}


@pytest.fixture
def station(bench: Bench) -> Station:
    """A robot that walks, whose data are not stale within a test."""
    bench.station.take([walking(400, -HOUR_S), looked()])  # fewer may begin between two steps
    return bench.station


class Parts(QWidget):
    """Header and overview without the rest of the window, which takes its time to be made."""

    def __init__(self, bench: Bench, theme: Theme) -> None:
        super().__init__()
        self.header, self.overview = (
            Header(bench.desk, theme, QPushButton("View")),
            Overview(bench.desk, theme),
        )
        column = QVBoxLayout(self)
        column.addWidget(self.header)
        column.addWidget(self.overview, 1)
        self.resize(1400, 900)

    def refresh(self) -> None:
        """Draw a frame in which all that is read is read."""
        self.overview.read_now()
        self.overview.refresh()
        self.header.refresh()


@pytest.fixture
def window(theme: Theme, bench: Bench) -> Iterator[Parts]:
    made = Parts(bench, theme)
    made.show()
    made.refresh()
    yield made
    destroy(made)


def chip(window: Parts) -> str:
    return window.header._chips["status"].toolTip()


def shown(window: Parts, so: Callable[[], bool]) -> None:
    def drawn() -> bool:
        window.refresh()
        return so()

    wait(drawn, "shown")


def test_what_is_predicted_is_said_with_how_sure_and_what_else_it_may_be(
    window: Parts, station: Station
) -> None:
    station.take_prediction(predicted("walk", WALKS))
    said = f"predicted, {UNCHECKED} · else turn 4 %"
    shown(window, lambda: chip(window) == f"Walk\n{said}")
    assert window.header._chips["status"]._words.parts == ("not checked", "predicted")
    now = window.overview.now.activity
    shown(window, lambda: now.main.text().startswith("Walk  "))
    assert now.detail.text() == said
    assert re.search(r"Activity of [^\n]+, activity-3fa2c1", now.toolTip())
    assert "activity-3fa2c1" not in now.main.text() + now.detail.text(), "nobody reads a model's hash"
    assert window.overview._ring._word == "Walk", "94 % looks like how often it is right"


@pytest.mark.parametrize("label", ["steady", "fall"])
def test_no_percentage_stands_without_how_far_to_believe_it(station: Station, label: str) -> None:
    """On a narrow card it said `Balance: Steady 100 %` alone."""
    station.take_prediction(predicted(label, {label: 0.97, "slip": 0.03}, task="falling"))
    balance = next(line for line in lines(station) if line.text.startswith("Balance: "))
    assert balance.wordings[0].startswith(f"Balance: {label.capitalize()} 97 % · not yet checked")
    assert all("not yet checked" in said for said in balance.wordings if "%" in said)
    least = "Balance: Steady, not checked" if label == "steady" else "Balance: Fall"
    assert balance.wordings[-1] == least


def test_how_right_the_model_was_of_late_stands_beside_it(station: Station) -> None:
    quality = Quality(312, 292, 1, 19, {}, seconds=312, recordings=3)
    station.take_prediction(dataclasses.replace(predicted("walk", WALKS), quality=quality))
    line = activity(station)
    assert line.text == "Walk 94 %"
    assert line.detail == "right 94 % last week (5 min in 3 recordings) · else turn 4 %"
    assert line.short == "right 94 % last week"
    assert "93.6 % right, 0.3 % wrong, 6.1 % not said of 5 min in 3 recordings" in line.tip


@pytest.mark.parametrize(
    ("seconds", "recordings", "basis"), [(59, 2, "59 s in 2 recordings"), (600, 1, "10 min in 1 recording")]
)
def test_where_too_little_was_labelled_that_is_said_and_no_percentage(
    station: Station, seconds: int, recordings: int, basis: str
) -> None:
    quality = Quality(1000, 1000, 0, 0, {}, seconds, recordings)
    station.take_prediction(dataclasses.replace(predicted("walk", WALKS), quality=quality))
    line = activity(station)
    assert line.text == "Walk", "not checked: as little as without any label"
    assert line.detail.startswith(f"predicted, too little labelled to tell ({basis})")
    assert line.short == "predicted, too little labelled to tell"
    assert f"too little labelled to tell: {basis}; it takes 1 min in 2" in line.tip
    assert "100" not in line.text + line.detail + line.short + line.tip


def test_labels_of_one_class_prove_nothing_of_a_model_that_knows_more(station: Station) -> None:
    quality = Quality(600, 600, 0, 0, {"walk": {"walk": 600}}, seconds=300, recordings=3)
    station.take_prediction(dataclasses.replace(predicted("walk", WALKS), quality=quality))
    line = activity(station)
    assert line.text == "Walk"
    assert line.short == "predicted, only walk was labelled"
    both = msgspec.structs.replace(quality, confusion={"walk": {}, "sit": {}})
    station.take_prediction(dataclasses.replace(predicted("walk", WALKS), quality=both))
    assert activity(station).text == "Walk 94 %"


@pytest.mark.parametrize(
    ("label", "novelty", "said"),
    [
        ("unknown", 0.2, f"Unknown\npredicted · {UNCHECKED} · likeliest walk 41 %"),
        ("abnormal", 1.7, f"Abnormal\npredicted · novelty 1.7 · {UNCHECKED} · likeliest walk 41 %"),
    ],
)
def test_a_model_that_does_not_know_says_so(
    window: Parts, station: Station, label: str, novelty: float, said: str
) -> None:
    station.take_prediction(predicted(label, {"walk": 0.41, "stand": 0.4}, novelty=novelty))
    shown(window, lambda: chip(window) == said)
    assert window.overview._ring._word == label.capitalize(), "the probability is another class's"


def test_what_it_may_be_is_said_where_a_model_abstains(station: Station) -> None:
    """Of so few classes that this says anything."""
    unsure = predicted("unknown", {"walk": 0.5, "stairs_up": 0.4, "ramp": 0.1})
    for either, detail in (
        (("walk", "stairs_up"), "walk or stairs up"),
        (("walk", "stairs_up", "ramp", "turn"), "likeliest walk 50 %"),
    ):
        prediction = dataclasses.replace(unsure.prediction, either=either)
        station.take_prediction(dataclasses.replace(unsure, prediction=prediction))
        assert activity(station).detail == f"{UNCHECKED} · {detail}"


def test_a_fall_stands_before_all_else(station: Station) -> None:
    station.take_prediction(predicted("walk", WALKS))
    station.take_prediction(predicted("steady", {"steady": 0.99, "fall": 0.01}, "falling"))
    line = status(station)
    assert line is not None
    assert line.text == "Walk"
    station.take_prediction(predicted("fall", {"steady": 0.03, "fall": 0.97}, "falling"))
    line = status(station)
    assert line is not None
    assert (line.mark.shape, line.mark.colour, line.text) == ("square", "bad", "Fall 97 %")


def test_a_robot_that_differs_from_what_was_learned_is_said_to(station: Station) -> None:
    drifted = Trust(600, 0.0, 0.0, 0.5, {"left_hip.position": 0.4})
    station.take_prediction(predicted("walk", WALKS, trust=drifted, source=DataSource.RECORDED))
    line = status(station)
    assert line is not None
    assert "unlike what it has learned (left_hip.position): do not rely on it" in line.detail


def test_a_doubtful_prediction_does_not_look_sure_in_header_and_card(window: Parts, station: Station) -> None:
    drifted = Trust(600, 0.0, 0.0, 0.5, {"left_hip.position": 0.4})
    station.take_prediction(predicted("walk", {"walk": 1.0}, trust=drifted))
    window.header.refresh()
    words = window.header._chips["status"]._words
    assert (words.main, words.parts) == ("Walk?", ("doubtful", "predicted"))
    assert all("%" not in wording for wording in doing(station))
    assert doing(station)[0].startswith("Walk? 120 steps/min · ")
    station.take_prediction(predicted("walk", {"walk": 1.0}))
    window.header.refresh()
    assert "doubtful" not in window.header._chips["status"]._words.parts
    assert doing(station)[0].startswith("Walk 120 steps/min · ")


@pytest.mark.parametrize(
    ("states", "held", "why", "word"),
    [
        (dict.fromkeys(JOINTS, 6.0), True, "a stop is held", "Stopped"),
        (dict.fromkeys(JOINTS, 5.0), False, "drives stop", "Stopping"),
        (dict.fromkeys(JOINTS, 6.0), False, "no drive is enabled", "Drives off"),
        ({"left_knee": 7.0}, False, "a drive is in fault", "In fault"),
        (
            dict.fromkeys(JOINTS, 6.0) | {"left_knee": None},
            False,
            "1 of 6 drives not known, no other is enabled",
            "Not judged",
        ),
    ],
)
def test_a_robot_that_does_not_drive_its_wearer_is_not_judged(
    window: Parts, station: Station, states: dict[str, float | None], held: bool, why: str, word: str
) -> None:
    drifted = Trust(600, 0.9, 0.0, 3.5, {"left_hip.position": 0.4})
    station.take_prediction(predicted("abnormal", {"walk": 0.41}, novelty=3.5, trust=drifted))
    station.stopping.described(held, None)
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {f"{name}.state": [state] for name, state in states.items()}
    if columns:
        station.take([telemetry([now_ns], columns, now_ns)])
    line = status(station)
    assert line is not None
    assert (line.text, line.mark.colour, line.detail) == ("Not judged", "dim", why)
    window.overview.refresh()
    ring = window.overview._ring
    assert (ring._word, ring._below) == (word, "not judged")
    assert not any((*ring._phases.values(), *ring._modelled.values())), "a share of a stride is shown"
    station.take_prediction(predicted("steady", {"steady": 1.0, "fall": 0.0}, "falling"))
    station.take_prediction(predicted("stride", {"stride": 1.0}, "gait_phase"))
    judged = [one for one in lines(station) if one.text.startswith(("Balance", "Stride"))]
    words = [(one.text, one.mark.colour, one.detail) for one in judged]
    assert words == [("Balance: Not judged", "dim", why)], "a prediction is shown as current"
    station.take_prediction(predicted("fall", {"steady": 0.03, "fall": 0.97}, "falling"))
    line = status(station)
    assert line is not None
    assert line.text == "Fall 97 %", "a fall is told of a stopped robot, too"


def test_a_wearer_is_not_called_abnormal_where_a_part_is_lost(window: Parts, station: Station) -> None:
    station.take([looked(state="lost", problem="its heartbeat is missing")])
    station.take_prediction(predicted("abnormal", WALKS, novelty=3.1))
    assert activity(station).wordings[0] == "Not judged · nothing comes from left knee"
    shown(window, lambda: chip(window).startswith("Not judged"))
    station.take_prediction(predicted("walk", WALKS))
    assert activity(station).text == "Walk"


def test_a_prediction_that_is_old_is_not_shown_as_one(window: Parts, station: Station) -> None:
    station.take_prediction(predicted("walk", WALKS))
    newest = station.predictions.by_task["activity"]
    station.predictions.by_task["activity"] = dataclasses.replace(
        newest, came_ns=time.monotonic_ns() - 5 * 10**9
    )
    shown(window, lambda: "from the steps seen · no prediction now, the last " in chip(window))
    assert chip(window).startswith("Walk\n"), "in the word that the model has for it"
    assert isinstance(newest, NewestPrediction)
    assert window.overview._ring._word == "Walk"
    assert doing(station)[0].startswith("Walk 120 steps/min · ")


def test_what_keeps_a_model_from_predicting_is_said_beside_the_steps(station: Station) -> None:
    assert activity(station).detail == "from the steps seen; model not ready yet"
    said = predicted("walk", WALKS)
    card = msgspec.structs.replace(said.card, channels=("left_knee.position", "right_knee.position"))
    station.take_prediction(dataclasses.replace(said, card=card))
    newest = station.predictions.by_task["activity"]
    old = dataclasses.replace(newest, came_ns=time.monotonic_ns() - 5 * 10**9)
    station.predictions.by_task["activity"] = old
    assert activity(station).detail == "from the steps seen; the model predicts nothing now"
    station.take([looked(state="lost", problem="its heartbeat is missing")])
    assert activity(station).detail == "from the steps seen; the model needs the left knee"
    station.take_prediction(Serves("exo-01", {}, {"activity": "no model serves activity"}))
    assert activity(station).detail == "from the steps seen, without a model"


def test_without_a_model_it_says_how_to_get_one_and_shows_the_steps(window: Parts, station: Station) -> None:
    station.take_prediction(
        Serves("exo-01", {}, {"activity": "no model serves activity: gwrms models promote ID"})
    )
    shown(
        window,
        lambda: chip(window).endswith("not predicted: no model serves activity: gwrms models promote ID"),
    )
    assert chip(window).startswith("Walk\n"), "in the word that the model has for it"
    assert chip(window).partition("\n")[2].startswith(window.header._chips["status"].detail_text)
    station.predictions.off = True
    shown(window, lambda: f"Not predicted · {OFF}" in window.overview.status_lines.texts)


def test_steps_and_model_are_one_number_and_said_to_differ_where_they_do(station: Station) -> None:
    derived = station.processing.derived()
    seen = leg_phase(derived, Leg.LEFT, derived.stamp_ns)
    assert seen is not None
    share = seen.percent / 100
    for late_s, off, said in ((0.0, 0.0, "agree"), (0.2, -0.2, "agree"), (0.0, 0.14, "14 % apart")):
        values = {"left": (share + off) % 1.0}
        news = predicted("stride", {"stride": 0.9}, "gait_phase", values=values)
        stamp_ns = derived.stamp_ns - round(late_s * 1e9)
        prediction = dataclasses.replace(news.prediction, stamp_ns=stamp_ns)
        station.take_prediction(dataclasses.replace(news, prediction=prediction))
        line = next(one for one in lines(station) if one.text.startswith("Stride"))
        assert line.text.endswith(said)


def test_the_model_s_phase_stands_beside_that_of_the_steps(window: Parts, station: Station) -> None:
    station.take_prediction(
        predicted("stride", {"stride": 0.9}, "gait_phase", values={"left": 0.25, "right": 0.75})
    )
    phases = model_phases(station)
    assert [(phase.percent, phase.phase) for phase in phases.values() if phase] == [
        (25.0, "mid-stance"),
        (75.0, "mid-swing"),
    ]
    window.refresh()
    assert window.overview._ring._modelled == phases
    assert window.overview._ring._phases[Leg.LEFT] is not None
    shown(window, lambda: window.overview.status_lines.texts[0].startswith("Stride: "))
    station.take_prediction(
        predicted("unknown", {"stride": 0.2}, "gait_phase", values={"left": 0.25, "right": 0.75})
    )
    assert model_phases(station) == dict.fromkeys(Leg)


def test_rules_that_hold_and_devices_in_trouble_stand_beside(window: Parts, station: Station) -> None:
    fall = predicted("fall", {"fall": 0.97, "steady": 0.03}, "falling")
    rule = RuleSettings("falling", "fall", 0.9, action=Action.ALARM)
    station.take_prediction(fall)
    station.take_prediction(Ruled("exo-01", rule, began=True, cause=fall))
    station.take([looked(state="fault", problem="i²t at 83 %")])
    shown(window, lambda: len(window.overview.status_lines.texts) == 3)
    texts = window.overview.status_lines.texts
    assert [text.partition(" · ")[0] for text in texts] == [
        "Balance: Fall 97 %",
        "Rule alarm",
        "left knee: unreliable",  # the word of its alarm
    ]
    assert texts[2].endswith("i²t at 83 %")


def test_nothing_is_predicted_of_a_robot_whose_link_is_gone(window: Parts, station: Station) -> None:
    station.take_prediction(predicted("walk", WALKS))
    station.take([LinkChanged(ConnectionState.WAITING, "no route", 0)])
    assert status(station) is None
    shown(window, lambda: not any("Walk" in text for text in window.overview.status_lines.texts))


def test_what_was_said_when_a_recording_was_made_is_said_to_be_of_then(
    window: Parts, station: Station
) -> None:
    walks = predicted("walk", WALKS).prediction
    station.predictions.recalled = {"activity": Recalled(walks, 0.1)}
    shown(window, lambda: window.overview._ring._word == "Walk 94 %")
    said = "said then by the activity model · else turn 4 %"
    shown(window, lambda: window.overview.now.activity.detail.text() == said)


def test_without_an_insole_its_leg_has_no_phase_and_the_stride_is_not_judged(station: Station) -> None:
    station.take_prediction(
        predicted("stride", {"stride": 0.9}, "gait_phase", values={"left": 0.25, "right": 0.75})
    )
    assert step_phases(station)[Leg.LEFT] is not None
    part = station.robot.parts["left_insole"]
    station.robot.parts["left_insole"] = dataclasses.replace(part, state="lost", problem="it is gone")
    assert step_phases(station)[Leg.LEFT] is None
    assert step_phases(station)[Leg.RIGHT] is not None
    assert model_phases(station) == dict.fromkeys(Leg)
    line = next(one for one in lines(station) if one.text.startswith("Stride"))
    assert (line.text, line.detail) == ("Stride: not judged", "nothing comes from left insole")


def test_of_a_lost_insole_it_is_said_by_what_its_leg_s_steps_are_seen(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its phase stood in the ring as if nothing had happened."""
    one = looked(state="lost", problem="it went away")
    quality = {"left_insole": one.quality.quality["left_knee"]}
    station.take([dataclasses.replace(one, quality=msgspec.structs.replace(one.quality, quality=quality))])
    derived = station.processing.derived()
    by = {Leg.LEFT: EventSource.KINEMATICS, Leg.RIGHT: EventSource.PRESSURE}
    shown = dataclasses.replace(derived, sources=by)
    monkeypatch.setattr(station.processing, "derived", lambda: shown)
    (line,) = (row for row in lines(station) if row.text.startswith("left insole"))
    assert line.detail == "it went away · steps by its joints"
    assert "left insole: lost · steps by its joints" in line.wordings
    assert instead_of_insoles(station) == ["left by its joints"]
    unnamed = PredictionRow(Mark("ring", "dim", "unnamed"), NOT_NAMED)
    assert most_needed([line, unnamed]) == [line], "what is worse needs the line"
    assert most_needed([unnamed]) == [unnamed]
