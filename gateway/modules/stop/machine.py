"""May anything move? The one state machine that knows, as one table: pure, without I/O, time or threads.

Stops, guard, hold, reset and enabling feed it and ask it; nobody else has an opinion. `TRANSITIONS` is all of
it: a phase and an input that stand there lead to the next phase and to what is to be done; an input that does
not stand there changes nothing, or, where somebody asked for it, is refused in the words of `REFUSALS`.

Whatever takes time (a stop, a reset, an enabling) is an undertaking with a number. A newer one makes an older
one's end meaningless: an end counts only with the newest number.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum


class Phase(StrEnum):
    """Phase of the stop. From `STOPPING` to `RELEASING` a stop is held."""

    FREE = "free"
    ENABLING = "enabling"
    LOWERING = "lowering"
    STOPPING = "stopping"
    HELD = "held"
    RESETTING = "resetting"
    RELEASING = "releasing"


class Input(StrEnum):
    """Input of the state machine."""

    STOP = "stop asked for"
    TRIP = "guard's rule trips"
    FOUND = "record found at start"
    SEEN = "drive seen enabled"
    LOST = "node lost or booted anew"
    ANSWERED = "stop answered"
    RESET = "reset asked for"
    PROVED = "rest proved"
    UNPROVED = "rest not proved"
    REMOVED = "record removed"
    KEPT = "record not removable"
    ENABLE = "enabling asked for"
    ENABLED = "enabling ended"


class Action(StrEnum):
    """Action of the state machine; carried out in this order."""

    STOP_ALL = "stop every drive and controller"
    STOP_AGAIN = "stop it again"
    RECORD = "write the record"
    WATCH = "watch over what is stopped"
    LOWER = "lead the drives down"
    REMOVE = "remove the record"
    RELEASE = "end the watch"
    RAISE = "lead the drives up"


HOLDING = frozenset({Phase.STOPPING, Phase.HELD, Phase.RESETTING, Phase.RELEASING})

_P, _I, _A = Phase, Input, Action
_NEW_STOP = (_P.STOPPING, (_A.STOP_ALL, _A.RECORD))
_ONCE_MORE = (_P.STOPPING, (_A.STOP_ALL,))  # of a stop that is held already, and stays whose it was

TRANSITIONS: Mapping[Phase, Mapping[Input, tuple[Phase, tuple[Action, ...]]]] = {
    _P.FREE: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _NEW_STOP,
        _I.FOUND: (_P.HELD, (_A.WATCH,)),
        _I.RESET: (_P.LOWERING, (_A.LOWER,)),
        _I.ENABLE: (_P.ENABLING, (_A.RAISE,)),
    },
    _P.ENABLING: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _NEW_STOP,
        _I.ENABLED: (_P.FREE, ()),
    },
    _P.LOWERING: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _NEW_STOP,
        _I.PROVED: (_P.FREE, ()),
        _I.UNPROVED: (_P.FREE, ()),
    },
    _P.STOPPING: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _ONCE_MORE,
        _I.SEEN: (_P.STOPPING, (_A.STOP_AGAIN,)),
        _I.ANSWERED: (_P.HELD, ()),
        _I.RESET: (_P.RESETTING, (_A.LOWER,)),
    },
    _P.HELD: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _ONCE_MORE,
        _I.SEEN: (_P.HELD, (_A.STOP_AGAIN,)),
        _I.RESET: (_P.RESETTING, (_A.LOWER,)),
    },
    _P.RESETTING: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _ONCE_MORE,
        _I.SEEN: (_P.RESETTING, (_A.STOP_AGAIN,)),
        _I.PROVED: (_P.RELEASING, (_A.REMOVE,)),
        _I.UNPROVED: (_P.HELD, ()),
    },
    _P.RELEASING: {
        _I.STOP: _NEW_STOP,
        _I.TRIP: _NEW_STOP,
        _I.SEEN: _NEW_STOP,
        _I.LOST: _NEW_STOP,
        _I.REMOVED: (_P.FREE, (_A.RELEASE,)),
        _I.KEPT: (_P.HELD, (_A.RECORD,)),
    },
}

_UNDER_WAY = {
    _P.ENABLING: "an enabling is under way; wait for its answer",
    _P.LOWERING: "a reset is under way; wait for its answer",
    _P.RESETTING: "a reset is under way; wait for its answer",
    _P.RELEASING: "a reset is under way; wait for its answer",
}
_HELD = dict.fromkeys(HOLDING, "a stop is held; reset it first")
# Why what somebody asks for is not done in a phase; for all else there is nobody to be told.
REFUSALS: Mapping[Input, Mapping[Phase, str]] = {_I.RESET: _UNDER_WAY, _I.ENABLE: _UNDER_WAY | _HELD}

_HOLD = frozenset({_A.STOP_ALL, _A.WATCH})  # from now on a stop is held
OVERTAKEN = "the robot was stopped after this was asked for; ask again"

_BEGIN = _HOLD | {_A.LOWER, _A.RAISE}  # what makes an undertaking
_ENDS = frozenset({_I.ANSWERED, _I.PROVED, _I.UNPROVED, _I.REMOVED, _I.KEPT, _I.ENABLED})


@dataclass(frozen=True, slots=True)
class ResetFinding:
    """A reset's finding about a drive or controller, and the time of the request behind it."""

    at_rest: bool
    asked_ns: int


@dataclass(frozen=True, slots=True)
class StopMachineState:
    """Everything that the machine knows. Times are ns of the monotonic clock."""

    targets: frozenset[str]  # every drive and controller of the robot's file, there or not
    phase: Phase = Phase.FREE
    number: int = 0  # of the newest undertaking
    stops: int = 0  # so far
    stopped_ns: int = 0  # when the newest stop was asked for, or found
    asked_ns: int = 0  # when the newest was asked for: what came in before is overtaken
    disturbed_ns: Mapping[str, int] = field(default_factory=dict)  # target → last seen enabled, or lost

    @property
    def held(self) -> bool:
        return self.phase in HOLDING


@dataclass(frozen=True, slots=True)
class Event:
    """One input, with what belongs to it: `target` of `SEEN` and `LOST`, `number` of an end.

    What is asked for counts from when it came in, `at_ns`. As long as a rule is `standing`, nothing is
    proved, reset or enabled; what `PROVED` says of rest counts only where its findings show that, target for
    target.
    """

    input: Input
    at_ns: int = 0
    target: str = ""
    number: int = 0
    standing: tuple[str, ...] = ()  # the guard's rules that stop, and are tripped at this moment, in words
    findings: Mapping[str, ResetFinding] = field(default_factory=dict)  # of `PROVED`


@dataclass(frozen=True, slots=True)
class Transition:
    """Result of an event: the new state, the actions due, and the reason of a refusal."""

    state: StopMachineState
    actions: tuple[Action, ...] = ()
    refusal: str | None = None

    @property
    def number(self) -> int:
        return self.state.number


def step(state: StopMachineState, event: Event) -> Transition:
    """Return the transition for an event."""
    if event.input in _ENDS and event.number != state.number:
        return Transition(state)
    if event.input in (Input.SEEN, Input.LOST):
        state = _disturbed(state, event)
    if event.input in REFUSALS and event.at_ns <= state.asked_ns:
        return Transition(state, (), OVERTAKEN)
    if event.standing and event.input in REFUSALS:
        return Transition(state, (), f"the guard's rule is tripped: {', '.join(event.standing)}")
    happened = event.input
    if happened is Input.PROVED and (event.standing or any(unproved(state, event.findings))):
        happened = Input.UNPROVED
    row = TRANSITIONS[state.phase].get(happened)
    if row is None:
        return Transition(state, (), REFUSALS.get(happened, {}).get(state.phase))
    phase, actions = row
    state = replace(state, phase=phase, number=state.number + (not _BEGIN.isdisjoint(actions)))
    if not _HOLD.isdisjoint(actions):
        state = replace(state, stopped_ns=event.at_ns)
    if Action.STOP_ALL in actions:
        state = replace(state, stops=state.stops + 1, asked_ns=event.at_ns)
    return Transition(state, actions)


def _disturbed(state: StopMachineState, event: Event) -> StopMachineState:
    at_ns = max(event.at_ns, state.disturbed_ns.get(event.target, 0))
    return replace(state, disturbed_ns={**state.disturbed_ns, event.target: at_ns})


def unproved(state: StopMachineState, findings: Mapping[str, ResetFinding]) -> Iterator[str]:
    """Targets that are not known to rest.

    A reading counts that was asked for after the last stop, and after the target was last seen enabled, or
    lost.
    """
    for target in sorted(state.targets):
        found = findings.get(target)
        since_ns = max(state.stopped_ns, state.disturbed_ns.get(target, 0))
        if found is None or not found.at_rest or found.asked_ns <= since_ns:
            yield target


def table() -> str:
    """`TRANSITIONS` as a table in Markdown, for people: one row an input, one column a phase."""
    lines = [["", *(f"**{phase}**" for phase in Phase)], ["---"] * (len(Phase) + 1)]
    lines += [[str(one), *(_cell(phase, one) for phase in Phase)] for one in Input]
    rows = [f"| {' | '.join(cells)} |" for cells in lines]
    return "\n".join([*rows, "", "; ".join(f"{_sign(one)} {one}" for one in Action)])


def _cell(phase: Phase, one: Input) -> str:
    row = TRANSITIONS[phase].get(one)
    if row is None:
        return "refused" if phase in REFUSALS.get(one, {}) else ""
    return " ".join([str(row[0]), *map(_sign, row[1])])


def _sign(action: Action) -> str:
    return "①②③④⑤⑥⑦⑧"[list(Action).index(action)]
