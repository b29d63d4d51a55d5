"""A thread that learns from wearers' walks beside the prediction, which never waits for it.

It has the priority of all others on purpose: a thread of lower priority would be put to sleep while it holds
the interpreter's lock, and everybody would wait for it. It gives way between the rounds of its learning.
"""

import collections
import logging
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Self

from threadpoolctl import threadpool_limits

from gateway.client import Batch, ConnectionState
from ml.serving.predictor import Window
from server_gui.core.follow.events import Described, Event, LinkChanged, Telemetry
from server_gui.core.prediction.adaptation import (
    BY_PERSON,
    LEARNED_S,
    NEXT,
    TRIED_S,
    AdaptationState,
    Adapting,
    Context,
    Happening,
    Tried,
    Wearing,
)
from server_gui.core.prediction.inbox import Inbox
from server_gui.core.prediction.model_loading import Model
from server_gui.core.prediction.training_data import TrainingData, learn, tried
from server_gui.core.threads.supervision import BEAT_S, Worker

log = logging.getLogger(__name__)

STILL_S: Final = 10.0  # the first learning imports scikit-learn
FEWEST_STRIDES: Final = 10  # that both models are tried on
SILENT_S: Final = 10.0  # a robot that told nothing for so long is gone, and its wearer
GIVE_WAY_S: Final = 0.005  # between two rounds of learning
MOST_WAITING: Final = 500  # things of a robot that wait for this thread; more are not kept
EMPTY: Final = Context(Wearing(), None, 0, is_linked=False, model=None)


@dataclass(frozen=True, slots=True)
class Began:
    """Everything begins anew, in this context."""

    context: Context
    every_ns: int
    turn: int  # counts a robot's contexts: of two that are alike, with another between, one has ended


@dataclass(frozen=True, slots=True)
class AttemptEvent:
    """A person, of the attempt of this number; or the thread that predicts, that the model breaks."""

    number: int
    what: Happening


NOTHING: Final = Began(EMPTY, 1, 0)
Thing = Began | AttemptEvent | Batch | list[Window]


class _Attempts:
    """One robot, for this module's thread: the attempt of now."""

    def __init__(self, robot: str, tell: Callable[[Adapting], None]) -> None:
        self.context, self.turn = EMPTY, 0
        self.now = Adapting(robot, 0, AdaptationState.OFF)
        self.adapted: Model | None = None
        self._tell = tell
        self._lesson: TrainingData | None = None
        self._every_ns = 1

    @property
    def listens(self) -> bool:
        """Whether it wants what the robot sends."""
        return self._lesson is not None

    @property
    def serves(self) -> Model | None:
        """The adapted model, while it serves."""
        return self.adapted if self.now.state is AdaptationState.SERVING else None

    def begin(self, began: Began) -> None:
        """Forget everything, and begin anew."""
        self.context, self.turn, self._every_ns = began.context, began.turn, began.every_ns
        self._enter(began.context.first, why=began.context.why_off)

    def happened(self, what: Happening, *, found: Tried | None = None, why: str = "") -> None:
        """Go where the table says; what is not in it changes nothing."""
        state = NEXT[self.now.state].get(what)
        if state is not None:
            self._enter(state, self.now.tried if found is None else found, why)

    def take(self, thing: Batch | list[Window], told: Callable[[], None]) -> None:
        """Take the robot's rows, or inputs of its model."""
        if self._lesson is None:
            return
        if isinstance(thing, list):
            self._lesson.ask(thing)
            return
        self._lesson.see(thing)
        self._look(self._lesson, told)

    def _look(self, lesson: TrainingData, told: Callable[[], None]) -> None:
        stepped_s, base = lesson.stepped_s, lesson.base
        if self.now.state is AdaptationState.COLLECTING and stepped_s >= LEARNED_S:
            self.happened(Happening.ENOUGH)
            self.adapted = learn(base, self.now.robot, self.now.wearer, lesson.rows, told)
            lesson.turn_page()
            self.happened(Happening.LEARNED)
        elif self.now.state is AdaptationState.TRYING and self.adapted is not None and _is_enough(lesson):
            found, is_better = tried(base, self.adapted, lesson.rows)
            self.happened(Happening.BETTER if is_better else Happening.NO_BETTER, found=found)
        elif int(stepped_s) != int(self.now.stepped_s):
            self._say(self.now.state, self.now.tried, stepped_s=stepped_s)

    def _enter(self, state: AdaptationState, found: Tried | None = None, why: str = "") -> None:
        is_new = state is self.context.first
        if is_new:
            found = None
        if state is AdaptationState.COLLECTING and self.context.model is not None:
            self._lesson = TrainingData(self.context.model, self._every_ns)
        elif state not in (AdaptationState.LEARNING, AdaptationState.TRYING):
            self._lesson = None  # nothing of the walk is kept
        if state not in (AdaptationState.TRYING, AdaptationState.OFFERED, AdaptationState.SERVING):
            self.adapted = None
        self._say(state, found, why=why, number=self.now.number + is_new)

    def _say(
        self,
        state: AdaptationState,
        found: Tried | None,
        *,
        stepped_s: float = 0.0,
        why: str = "",
        number: int | None = None,
    ) -> None:
        model = self.adapted.card.id if self.adapted is not None and state is AdaptationState.SERVING else ""
        number = self.now.number if number is None else number
        wearer = self.context.wearing.wearer
        is_same = (state, number) == (self.now.state, self.now.number)
        since_s = self.now.since_s if is_same else time.time()
        is_known = state is AdaptationState.OFF and (self.now.state, self.now.why) == (state, why)
        self.now = Adapting(self.now.robot, number, state, wearer, stepped_s, found, why, model, since_s)
        if not is_known:  # while there is no link, each attempt is a change
            self._tell(self.now)


class AdaptingService:
    """Learns from entering to leaving; use it as a context manager, which joins its thread.

    `wearing` says whose walk a robot's recording is of. `tell` is told how it goes, in other threads.
    `context`, `asked` and `broke` are for the thread that predicts; `say` is for any.
    """

    def __init__(self, wearing: Callable[[str], Wearing], tell: Callable[[Adapting], None]) -> None:
        self.now: Mapping[str, Adapting] = {}  # by robot, replaced as a whole
        self._wearing = wearing
        self._tell = tell
        self._inbox = Inbox[Thing]()
        self._contexts: dict[str, Began] = {}  # of the thread that predicts
        self._serving: Mapping[str, tuple[int, Model]] = {}  # with its turn, replaced as a whole
        self._listening: frozenset[str] = frozenset()  # likewise
        self._attempts: dict[str, _Attempts] = {}
        self._heard_s: dict[str, float] = {}  # when a robot told something last
        self._silences: collections.Counter[str] = collections.Counter()
        self._waiting: collections.Counter[str] = collections.Counter()
        self._lock = threading.Lock()  # of `_waiting`
        self._leaving = threading.Event()
        self.worker = Worker("adapting", self._run, STILL_S)

    def __enter__(self) -> Self:
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._leaving.set()
        self._inbox.close()
        self.worker.join()

    # --- the thread that predicts

    def serves(
        self, robot: str, events: Iterable[Event], model: Model | None, every_ns: int, bar: str = ""
    ) -> Model | None:
        """Hear what a robot has told, and which model serves it; return the adapted one that does instead.

        What was adapted in any other context serves from this call on no more.
        """
        before = self._contexts.get(robot, NOTHING)
        self._heard_s[robot] = time.monotonic()
        context = replace(
            _after(before.context, events),
            wearing=self._wearing(robot),
            model=model,
            bar=bar,
            silences=self._silences[robot],
        )
        now = before
        if context != before.context:
            now = self._contexts[robot] = Began(context, every_ns, before.turn + 1)
            self._inbox.put(robot, now)
        turn, adapted = self._serving.get(robot, (now.turn, None))
        return adapted if turn == now.turn else None

    def seen(self, robot: str, events: Iterable[Event]) -> None:
        """Hear what a robot sends."""
        if robot in self._listening:
            for event in events:
                if isinstance(event, Telemetry):
                    self._put(robot, event.batch)

    def asked(self, robot: str, windows: list[Window]) -> None:
        """Hear what the model was asked."""
        if robot in self._listening:
            self._put(robot, windows)

    def broke(self, robot: str) -> None:
        """Note that the adapted model cannot predict."""
        if robot in self.now:
            self._inbox.put(robot, AttemptEvent(self.now[robot].number, Happening.BROKE))

    def _put(self, robot: str, thing: Batch | list[Window]) -> None:
        with self._lock:
            if self._waiting[robot] >= MOST_WAITING:
                return
            self._waiting[robot] += 1
        self._inbox.put(robot, thing)

    # --- any thread

    def say(self, robot: str, number: int, what: Happening) -> None:
        """Accept, decline, take back, or try again; of an attempt that is over it changes nothing."""
        if what in BY_PERSON:
            self._inbox.put(robot, AttemptEvent(number, what))

    # --- its thread

    def _run(self) -> None:
        with threadpool_limits(limits=1):
            while (taken := self._inbox.take(BEAT_S)) is not None:
                self.worker.beat()
                for robot, things in taken.items():
                    self._robot(robot, things)
                self._drop_silent()

    def _robot(self, robot: str, things: Sequence[Thing]) -> None:
        known = self._attempts.get(robot)
        if known is None:
            known = self._attempts[robot] = _Attempts(robot, self._told)
        for thing in things:
            try:
                self._take(known, thing)
            except Exception as error:
                log.exception("%s: nothing can be learned from this walk", robot)
                known.happened(Happening.BROKE, why=f"internal error, {type(error).__name__}")
            if isinstance(thing, Batch | list):
                with self._lock:
                    self._waiting[robot] -= 1
            self._publish(known)

    def _take(self, known: _Attempts, thing: Thing) -> None:
        match thing:
            case Began():
                known.begin(thing)
            case AttemptEvent():
                if thing.number == known.now.number:
                    why = "the adapted model cannot be used" if thing.what is Happening.BROKE else ""
                    known.happened(thing.what, why=why)
            case _:
                known.take(thing, self._give_way)

    def _publish(self, known: _Attempts) -> None:
        robot, model = known.now.robot, known.serves
        others = {name: one for name, one in self._serving.items() if name != robot}
        self._serving = others if model is None else others | {robot: (known.turn, model)}
        listening = {name for name, one in self._attempts.items() if one.listens}
        self._listening = frozenset(listening)

    def _give_way(self) -> None:
        self.worker.beat()
        self._leaving.wait(GIVE_WAY_S)

    def _drop_silent(self) -> None:
        """Forget a robot that is not followed any more."""
        now_s = time.monotonic()
        for robot, known in self._attempts.items():
            if known.context != EMPTY and now_s - self._heard_s.get(robot, now_s) > SILENT_S:
                self._silences[robot] += 1  # so that it begins anew where it speaks again
                known.begin(NOTHING)
                self._publish(known)

    def _told(self, adapting: Adapting) -> None:
        self.now = {**self.now, adapting.robot: adapting}
        self._tell(adapting)


def _after(before: Context, events: Iterable[Event]) -> Context:
    """Return the robot's link and boot after these events."""
    boot_id, links, is_linked = before.boot_id, before.links, before.is_linked
    for event in events:
        match event:
            case LinkChanged():
                links, is_linked = links + 1, event.state is ConnectionState.CONNECTED
            case Described():
                boot_id, is_linked = event.description.boot_id, True
            case Telemetry():
                is_linked = True
            case _:
                pass
    return replace(before, boot_id=boot_id, links=links, is_linked=is_linked)


def _is_enough(lesson: TrainingData) -> bool:
    return lesson.stepped_s >= TRIED_S and lesson.strides >= FEWEST_STRIDES
