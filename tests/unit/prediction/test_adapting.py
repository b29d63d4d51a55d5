"""What was learned from a wearer serves that wearer alone, and only while somebody wants it."""

import functools
import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Final

import pytest

from gateway.client import Batch, ConnectionState
from server_gui.core.follow.events import Event, LinkChanged, Telemetry
from server_gui.core.prediction import adapting as module
from server_gui.core.prediction.adaptation import (
    BY_PERSON,
    NEXT,
    AdaptationState,
    Adapting,
    Happening,
    Tried,
    Wearing,
)
from server_gui.core.prediction.adapting import AdaptingService
from server_gui.core.prediction.model_loading import Model
from tests.unit.prediction import walkers
from tests.unit.prediction.robots import ROBOT

LOST = LinkChanged(ConnectionState.WAITING, "gone", 0)
BACK = LinkChanged(ConnectionState.CONNECTED, None, 0)
ROWS = Telemetry(1, Batch([0], {}, 0, 0, 0, 1, 0), None)


@dataclass
class Walk:
    """A lesson that has all that it takes at once."""

    base: Model
    every_ns: int
    rows: tuple[()] = ()
    stepped_s = 1e3
    strides = 99

    def see(self, _batch: Batch) -> None: ...

    def ask(self, _windows: list[object]) -> None: ...

    def turn_page(self) -> None: ...


class Bench:
    """The service without its thread: a robot, its wearer, the model that serves, and what comes of it."""

    def __init__(self) -> None:
        self.told: list[Adapting] = []
        self.wearing = Wearing("session-1", "P01")
        self.general: Model | None = walkers.model()
        self.bar = ""
        self.serves: Model | None = None
        self.is_learning = True
        self.service = AdaptingService(lambda _: self.wearing, self.told.append)

    @property
    def now(self) -> Adapting:
        return self.told[-1]

    def hear(self, *events: Event) -> None:
        """A turn of the thread that predicts, and then one of the thread that learns."""
        self.serves = self.service.serves(ROBOT, events, self.general, 1, self.bar)
        self.service.seen(ROBOT, events)
        self.learn()

    def learn(self) -> None:
        if not self.is_learning:
            return
        for robot, things in (self.service._inbox.take(0.0) or {}).items():
            self.service._robot(robot, things)

    def say(self, what: Happening) -> None:
        self.service.say(ROBOT, self.now.number, what)
        self.learn()
        self.hear(ROWS)

    def walk(self) -> None:
        """Until something is offered, where that may be."""
        for _ in range(3):
            self.hear(ROWS)


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    def learned(base: Model, _robot: str, wearer: str, *_: object) -> Model:
        return replace(base, learned_from=wearer, objection="not judged")

    monkeypatch.setattr(module, "TrainingData", Walk)
    monkeypatch.setattr(module, "learn", learned)
    monkeypatch.setattr(module, "tried", lambda *_: (Tried(3.4, 2.1, 30), True))
    made = Bench()
    made.hear(walkers.described(), ROWS)
    return made


@functools.cache
def general(name: str = "gait_phase-0123456789ab") -> Model:
    """One and the same: what is exchanged is known by its identity."""
    return walkers.model(name=name)


def put(**changes: object) -> Callable[[Bench], None]:
    def change(bench: Bench) -> None:
        for name, value in changes.items():
            setattr(bench, name, value)
        bench.hear(ROWS)

    return change


OPERATIONS: Final[dict[str, Callable[[Bench], None]]] = {
    "P01 is named": put(wearing=Wearing("session-1", "P01")),
    "P02 is named": put(wearing=Wearing("session-2", "P02")),
    "nobody is named": put(wearing=Wearing("session-1", "")),
    "the recording ends": put(wearing=Wearing()),
    "another is promoted": lambda bench: put(general=general("gait_phase-ba9876543210"))(bench),
    "it is rolled back": lambda bench: put(general=general())(bench),
    "no model serves": put(general=None),
    "a rule that stops": put(bar="a rule stops this robot"),
    "the link is lost": lambda bench: bench.hear(LOST),
    "the link is back": lambda bench: bench.hear(BACK),
    "it boots": lambda bench: bench.hear(walkers.described("boot-2")),
    "walk": Bench.walk,
    **{what.value: lambda bench, what=what: bench.say(what) for what in BY_PERSON},  # type: ignore[misc]
}
DROPS: Final = tuple(OPERATIONS)[:11]


def context(bench: Bench) -> object:
    """What it belongs to now: another object after whatever has changed, and be it back again."""
    return bench.service._contexts[ROBOT]


def sound(bench: Bench, accepted: object) -> object:
    """What serves is of this wearer, recording, link and model, and was accepted in this very context."""
    if bench.serves is None:
        return None
    assert bench.now.state is AdaptationState.SERVING
    assert bench.wearing.wearer == bench.serves.learned_from != ""
    assert bench.general is not None
    assert bench.serves.learned is bench.general.learned
    assert bench.serves.objection is not None, "no rule may stop a robot by it"
    assert accepted is context(bench)
    return accepted


@pytest.mark.parametrize("begin", ["collecting", "offered", "serving"])
def test_in_no_order_of_what_may_happen_it_serves_anybody_else(bench: Bench, begin: str) -> None:
    for order in itertools.product(OPERATIONS, repeat=2):
        for name, value in (("wearing", Wearing("session-1", "P01")), ("general", general()), ("bar", "")):
            setattr(bench, name, value)
        bench.hear(LOST)
        bench.hear(BACK)
        accepted = None
        steps = {"collecting": [], "offered": ["walk"], "serving": ["walk", "ACCEPT"]}[begin]
        for name in [*steps, *order, "walk", "ACCEPT"]:
            offered, before = bench.now.state is AdaptationState.OFFERED, bench.serves
            OPERATIONS[name](bench)
            if name == "ACCEPT" and offered:
                accepted = context(bench)
            sound(bench, accepted)
            if name == "TAKE BACK":
                assert bench.serves is None
            if name == "walk" or name in {what.value for what in BY_PERSON}:
                continue
            assert bench.serves is None or bench.serves is before, (name, order)


@pytest.mark.parametrize("what", DROPS)
def test_whatever_changes_ends_it_at_once(bench: Bench, what: str) -> None:
    """Before the thread that learns has heard of it."""
    bench.walk()
    bench.say(Happening.ACCEPT)
    assert bench.serves is not None
    number = bench.now.number
    bench.is_learning = False
    OPERATIONS[what](bench)
    assert (bench.serves is not None) == (what == "P01 is named")
    bench.is_learning = True
    bench.learn()
    assert (bench.now.number == number) == (what == "P01 is named")


def test_it_goes_from_a_minute_of_steps_to_an_offer_and_back(bench: Bench) -> None:
    bench.walk()
    assert [one.state for one in bench.told[-4:]] == [
        AdaptationState.COLLECTING, AdaptationState.LEARNING, AdaptationState.TRYING, AdaptationState.OFFERED,
    ]  # fmt: skip
    assert bench.now.text == "learned from P01: 3.4 → 2.1 % of the stride, on 30 later strides"
    assert bench.serves is None, "it serves when somebody wants it"
    bench.say(Happening.ACCEPT)
    assert bench.serves is not None
    assert bench.now.model == bench.serves.card.id
    bench.say(Happening.TAKE_BACK)
    assert (bench.serves, bench.now.state) == (None, AdaptationState.TAKEN_BACK)
    assert bench.service._attempts[ROBOT].adapted is None, "what was taken back is forgotten"
    bench.say(Happening.AGAIN)
    assert [one.state for one in bench.told[-3:]] == [
        AdaptationState.COLLECTING,
        AdaptationState.LEARNING,
        AdaptationState.TRYING,
    ]


def test_nobody_named_is_said_and_never_learned_from(bench: Bench) -> None:
    bench.wearing = Wearing("session-1", "")
    bench.walk()
    assert bench.now.text.startswith("name the wearer to learn from the walk")
    assert ROBOT not in bench.service._listening
    bench.wearing = Wearing()
    bench.walk()
    assert bench.now.text == "nothing is learned from a walk that is not recorded"


def test_attempts_at_a_link_are_no_news(bench: Bench) -> None:
    bench.hear(LOST)
    assert (bench.now.state, bench.now.text) == (AdaptationState.OFF, "")
    count = len(bench.told)
    for _ in range(3):
        bench.hear(LOST)
    assert len(bench.told) == count


def test_what_was_said_to_an_offer_that_is_over_changes_nothing(bench: Bench) -> None:
    bench.walk()
    stale = bench.now.number
    bench.wearing = Wearing("session-2", "P02")
    bench.walk()
    assert bench.now.state is AdaptationState.OFFERED
    bench.service.say(ROBOT, stale, Happening.ACCEPT)
    bench.learn()
    bench.hear(ROWS)
    assert (bench.serves, bench.now.state) == (None, AdaptationState.OFFERED)


def test_what_is_no_better_is_said_and_cannot_be_accepted(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "tried", lambda *_: (Tried(3.4, 3.3, 30), False))
    bench.walk()
    assert bench.now.text == "learned from P01: no better than the general model (3.4 → 3.3 %)"
    bench.say(Happening.ACCEPT)
    assert bench.serves is None
    assert bench.now.choices == (Happening.AGAIN,)


def test_what_cannot_be_learned_from_is_said_and_disturbs_nobody(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def breaks(*_: object) -> Model:
        raise ValueError("some array")

    monkeypatch.setattr(module, "learn", breaks)
    bench.walk()
    assert bench.now.text == "not learned from P01: internal error, ValueError"
    assert "nothing can be learned from this walk" in caplog.text


def test_a_robot_that_falls_silent_is_forgotten_and_begins_anew(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.walk()
    monkeypatch.setattr(module, "SILENT_S", -1.0)
    bench.service._drop_silent()
    assert bench.now.state.value == "off"
    assert bench.service._attempts[ROBOT].adapted is None
    monkeypatch.undo()
    bench.hear(ROWS)
    assert bench.now.state is AdaptationState.COLLECTING


def test_more_than_can_be_learned_from_in_time_is_not_kept(bench: Bench) -> None:
    for _ in range(module.MOST_WAITING + 7):
        bench.service.seen(ROBOT, [ROWS])
    taken = bench.service._inbox.take(0.0)
    assert taken is not None
    assert len(taken[ROBOT]) == module.MOST_WAITING


def test_nothing_but_an_offer_that_is_accepted_leads_to_serving() -> None:
    leads = [
        (state, what) for state, row in NEXT.items() for what in row if row[what] is AdaptationState.SERVING
    ]
    assert leads == [(AdaptationState.OFFERED, Happening.ACCEPT)]
    assert NEXT.keys() == set(AdaptationState)
    reached: Iterable[AdaptationState] = {
        AdaptationState.OFF,
        AdaptationState.UNNAMED,
        AdaptationState.COLLECTING,
    }
    for _ in AdaptationState:
        reached = {*reached, *(after for state in reached for after in NEXT[state].values())}
    assert set(reached) == set(AdaptationState)
