"""From a walk to an offer, and to what serves: in the threads that do it, with a registry and rules."""

import itertools
from collections.abc import Iterator

import pytest
from msgspec.structs import replace

from ml.registry.registry import Registry
from server_gui.core.fleet.live_prediction import RecordedPrediction
from server_gui.core.follow.events import Telemetry
from server_gui.core.models.names import told_name, told_task
from server_gui.core.prediction import adapting, inbox, robot_predictor
from server_gui.core.prediction.adaptation import AdaptationState, Adapting, Happening, Tried, Wearing
from server_gui.core.prediction.service import BARRED, PredictionService
from server_gui.core.recording.batching import EventKind
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import ServerSettings
from tests.unit.prediction import walkers
from tests.unit.prediction.robots import ROBOT, Told, promoters, publish, settings

LATE = 0.08
STOPS = RuleSettings("gait_phase", "abnormal", 1.0, action=Action.STOP)


@pytest.fixture(autouse=True)
def unhurried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tests send at once what robots send in seconds; and a few seconds of steps must do."""
    monkeypatch.setattr(robot_predictor, "LATE_NS", 3_600_000 * walkers.MS)
    monkeypatch.setattr(inbox, "MOST_NS", 3_600_000 * walkers.MS)
    monkeypatch.setattr(adapting, "LEARNED_S", 6.0)
    monkeypatch.setattr(adapting, "TRIED_S", 4.0)
    monkeypatch.setattr(adapting, "FEWEST_STRIDES", 2)


class Lab:
    """A robot that somebody wears, who walks for as long as anybody waits."""

    def __init__(self, server: ServerSettings) -> None:
        self.wearing = Wearing("session-1", "P01")
        self.told = Told()
        self.service = PredictionService(server, self.told.tell, self.told.stop, lambda _: self.wearing)
        self._sent: Iterator[Telemetry] = itertools.chain.from_iterable(
            walkers.events(30.0, LATE, seed, begin_ms=seed * 30_000) for seed in itertools.count()
        )

    def walk(self) -> None:
        for event in itertools.islice(self._sent, 10):
            self.service.take(ROBOT, event)

    def served(self) -> None:
        self.service.take(ROBOT, walkers.described())
        self.told.until(lambda: (ROBOT, "gait_phase") in self.service.models)

    def until(self, state: AdaptationState) -> Adapting:
        self.told.until(lambda: self.adapting().state is state, self.walk)
        return self.adapting()

    def adapting(self) -> Adapting:
        found = [one for one in self.told.news if isinstance(one, Adapting)]
        return found[-1] if found else Adapting(ROBOT, 0, AdaptationState.OFF)

    def until_served_by(self, wearer: str) -> None:
        def is_so() -> bool:
            return bool(self.told.predicted()) and self.told.predicted()[-1].learned_from == wearer

        self.told.until(is_so, self.walk)


def general(url: str, by: str | None = None) -> str:
    model = walkers.model()
    return publish(url, model.learned, by=by, units=model.card.units)


def test_a_wearer_is_served_by_what_was_learned_until_anybody_else_is_named(folder_url: str) -> None:
    name = general(folder_url)
    lab = Lab(settings(folder_url, STOPS))
    with lab.service:
        lab.served()
        offered = lab.until(AdaptationState.OFFERED)
        assert {one.learned_from for one in lab.told.predicted()} == {""}
        lab.service.say(ROBOT, offered.number, Happening.ACCEPT)
        lab.until_served_by("P01")
        serves = lab.told.predicted()[-1]
        assert serves.prediction.model == serves.card.id == lab.adapting().model
        assert serves.card.parent == name
        assert any(": serves" in text for text in lab.service.state.adapting.values())
        lab.wearing = Wearing("session-2", "P02")
        lab.until_served_by("")
        assert lab.told.predicted()[-1].card.id == name
        lab.until(AdaptationState.COLLECTING)
    assert lab.adapting().wearer == "P02"


def test_where_a_rule_may_stop_the_robot_by_it_no_unproven_model_is_offered(folder_url: str) -> None:
    general(folder_url, by="operator")
    server = replace(settings(folder_url, STOPS), promoters=promoters("operator"))
    lab = Lab(server)
    with lab.service:
        lab.served()
        lab.told.until(lambda: lab.adapting().why == BARRED, lab.walk)
        assert lab.adapting().state is AdaptationState.OFF


def test_a_model_that_is_promoted_meanwhile_serves_at_once(folder_url: str) -> None:
    general(folder_url)
    lab = Lab(settings(folder_url))
    with lab.service:
        lab.served()
        lab.service.say(ROBOT, lab.until(AdaptationState.OFFERED).number, Happening.ACCEPT)
        lab.until_served_by("P01")
        model = walkers.model()
        other = publish(folder_url, model.learned, units=model.card.units, notes="another")
        lab.told.until(lambda: lab.told.predicted()[-1].card.id == other, lab.walk)
        Registry(folder_url).rollback("gait_phase", who="tester")
        lab.told.until(lambda: lab.told.predicted()[-1].card.id not in ("", other), lab.walk)
        assert lab.told.predicted()[-1].learned_from == ""


def test_an_adapted_model_that_breaks_gives_way_to_the_general_one(
    folder_url: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    name = general(folder_url)
    lab = Lab(settings(folder_url))
    with lab.service:
        lab.served()
        offered = lab.until(AdaptationState.OFFERED)
        adapted = lab.service._adapting._attempts[ROBOT].adapted  # type: ignore[union-attr]
        assert adapted is not None
        adapted.learned.parts.pop("network")
        lab.service.say(ROBOT, offered.number, Happening.ACCEPT)
        assert lab.until(AdaptationState.FAILED).why == "the adapted model cannot be used"
        count = len(lab.told.predicted())
        lab.told.until(lambda: len(lab.told.predicted()) > count, lab.walk)
    assert lab.told.predicted()[-1].card.id == name
    assert "breaks; it serves no more" in caplog.text


def test_a_recording_keeps_which_model_served_and_until_when_without_a_name() -> None:
    kept: list[tuple[str, str, object]] = []

    class Recorder:
        def event(self, robot: str, kind: EventKind, text: str, **data: object) -> None:
            kept.append((kind.value, text, data["model"]))

    one = object.__new__(RecordedPrediction)
    one._recorder, one._show, one._own_models = Recorder(), None, {}  # type: ignore[assignment]
    one._session = lambda _: "session-1"
    serving = Adapting(
        ROBOT, 1, AdaptationState.SERVING, "P01", tried=Tried(3.4, 2.1, 30), model="gait_phase-77.w1"
    )
    one._keep([Adapting(ROBOT, 1, AdaptationState.OFFERED, "P01"), serving, serving])
    one._keep([Adapting(ROBOT, 1, AdaptationState.TAKEN_BACK, "P01")])
    assert kept == [
        (
            "adapted",
            "gait_phase-77.w1 serves, learned from the wearer's walk: 3.4 → 2.1 % of the stride",
            "gait_phase-77.w1",
        ),
        ("adapted", "gait_phase-77.w1 serves no more", "gait_phase-77.w1"),
    ]
    assert told_name("gait_phase-77ab12.w1") == "model 77ab of gait phase, learned from its wearer"
    assert told_task("gait_phase-77ab12.w1") == "the gait phase model, learned from its wearer"
    assert told_task("gait_phase-77ab12") == "the gait phase model"
    assert told_name("gait_phase-77ab12") == "model 77ab of gait phase"
