"""The stop machine alone: every order of everything that can happen, and what no order may lead to."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.modules.stop.machine import (
    HOLDING,
    OVERTAKEN,
    REFUSALS,
    TRANSITIONS,
    Action,
    Event,
    Input,
    Phase,
    ResetFinding,
    StopMachineState,
    Transition,
    step,
    table,
    unproved,
)

TARGETS = frozenset({"left_knee", "gait"})
STOPS = (Input.STOP, Input.TRIP)
RESTS = {name: ResetFinding(at_rest=True, asked_ns=100) for name in TARGETS}


def at(phase: Phase, **changes: object) -> StopMachineState:
    return replace(StopMachineState(TARGETS, phase, number=7, stops=2, stopped_ns=50), **changes)  # type: ignore[arg-type]


def proof(**findings: ResetFinding) -> Event:
    return Event(Input.PROVED, number=7, findings={**RESTS, **findings})


@pytest.mark.parametrize("what", STOPS)
@pytest.mark.parametrize("phase", Phase)
def test_a_stop_is_always_accepted_and_goes_to_everything(phase: Phase, what: Input) -> None:
    after = step(at(phase), Event(what, 200))
    assert (after.refusal, after.state.phase) == (None, Phase.STOPPING)
    assert after.actions[0] is Action.STOP_ALL
    assert (after.state.number, after.state.stops, after.state.stopped_ns) == (8, 3, 200)


@pytest.mark.parametrize("phase", Phase)
def test_a_guards_stop_leaves_a_held_one_as_it_is_but_never_one_whose_record_goes(phase: Phase) -> None:
    keeps = phase in HOLDING and phase is not Phase.RELEASING
    assert (Action.RECORD in step(at(phase), Event(Input.TRIP, 200)).actions) is not keeps


def test_only_enabling_and_a_reset_can_be_refused() -> None:
    asked = {Input.RESET, Input.ENABLE}
    refused = {
        what for what in Input for phase in Phase if step(at(phase), Event(what, 100)).refusal is not None
    }
    assert refused == asked == set(REFUSALS)


@pytest.mark.parametrize("phase", Phase)
def test_drives_are_led_up_only_where_nothing_is_held_or_under_way(phase: Phase) -> None:
    after = step(at(phase), Event(Input.ENABLE, 100))
    assert (Action.RAISE in after.actions) is (phase is Phase.FREE)
    assert (after.refusal is None) is (phase is Phase.FREE)


@pytest.mark.parametrize("what", [Input.RESET, Input.ENABLE])
@pytest.mark.parametrize("phase", Phase)
def test_nothing_is_reset_or_enabled_while_a_rule_that_stops_is_tripped(phase: Phase, what: Input) -> None:
    after = step(at(phase), Event(what, 100, standing=("tilt (1 rad)",)))
    assert (after.actions, after.state.phase) == ((), phase)
    assert "tilt (1 rad)" in str(after.refusal)


@pytest.mark.parametrize("what", [Input.RESET, Input.ENABLE])
@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("asked_ns", [99, 100])
def test_what_came_in_before_the_newest_stop_is_not_done(phase: Phase, what: Input, asked_ns: int) -> None:
    stopped = at(phase, asked_ns=100)
    assert step(stopped, Event(what, asked_ns)) == Transition(stopped, (), OVERTAKEN)


def test_a_record_that_is_found_overtakes_nothing() -> None:
    found = step(StopMachineState(TARGETS), Event(Input.FOUND, 100)).state
    assert (found.phase, found.stopped_ns, found.asked_ns) == (Phase.HELD, 100, 0)
    assert step(found, Event(Input.RESET, 50)).state.phase is Phase.RESETTING


@pytest.mark.parametrize("what", [Input.ANSWERED, Input.PROVED, Input.UNPROVED, Input.REMOVED, Input.KEPT])
@pytest.mark.parametrize("phase", Phase)
@pytest.mark.parametrize("number", [6, 8])
def test_an_end_counts_only_of_the_newest_undertaking(phase: Phase, what: Input, number: int) -> None:
    assert step(at(phase), Event(what, number=number, findings=RESTS)) == Transition(at(phase))


class TestProof:
    def test_every_drive_and_controller_read_at_rest_after_the_stop(self) -> None:
        after = step(at(Phase.RESETTING), proof())
        assert (after.state.phase, after.actions) == (Phase.RELEASING, (Action.REMOVE,))

    @pytest.mark.parametrize(
        "finding",
        [
            ResetFinding(at_rest=False, asked_ns=100),
            ResetFinding(at_rest=True, asked_ns=50),
            ResetFinding(True, 0),
        ],
        ids=["not at rest", "asked for when it was stopped", "never asked for"],
    )
    @pytest.mark.parametrize("target", sorted(TARGETS))
    def test_one_that_is_not_known_to_rest_keeps_the_hold(self, target: str, finding: ResetFinding) -> None:
        assert step(at(Phase.RESETTING), proof(**{target: finding})).state.phase is Phase.HELD

    @pytest.mark.parametrize("target", sorted(TARGETS))
    def test_one_that_was_not_read_at_all_keeps_the_hold(self, target: str) -> None:
        findings = {name: one for name, one in RESTS.items() if name != target}
        event = Event(Input.PROVED, number=7, findings=findings)
        assert step(at(Phase.RESETTING), event).state.phase is Phase.HELD
        assert list(unproved(at(Phase.RESETTING), findings)) == [target]

    @pytest.mark.parametrize("what", [Input.SEEN, Input.LOST])
    @pytest.mark.parametrize(
        ("seen_ns", "phase"), [(99, Phase.RELEASING), (100, Phase.HELD), (101, Phase.HELD)]
    )
    def test_a_reading_from_before_it_was_seen_enabled_or_lost_says_nothing(
        self, what: Input, seen_ns: int, phase: Phase
    ) -> None:
        disturbed = step(at(Phase.RESETTING), Event(what, seen_ns, "left_knee")).state
        assert disturbed.phase is Phase.RESETTING
        assert step(disturbed, proof()).state.phase is phase

    def test_what_was_seen_earlier_does_not_undo_what_was_seen_later(self) -> None:
        state = at(Phase.RESETTING)
        for seen_ns in (101, 60):
            state = step(state, Event(Input.SEEN, seen_ns, "gait")).state
        assert step(state, proof()).state.phase is Phase.HELD

    def test_a_rule_that_stands_tripped_keeps_the_hold(self) -> None:
        event = replace(proof(), standing=("tilt (1 rad)",))
        assert step(at(Phase.RESETTING), event).state.phase is Phase.HELD

    def test_what_moves_while_the_record_goes_is_a_stop_anew(self) -> None:
        after = step(at(Phase.RELEASING), Event(Input.SEEN, 200, "left_knee"))
        assert (after.state.phase, after.actions) == (Phase.STOPPING, (Action.STOP_ALL, Action.RECORD))

    def test_a_record_that_cannot_be_removed_keeps_the_hold(self) -> None:
        assert step(at(Phase.RELEASING), Event(Input.KEPT, number=7)).state.phase is Phase.HELD


def orders(state: StopMachineState, depth: int) -> Iterator[tuple[StopMachineState, Event, Transition]]:
    """Every event in every state that can be reached; a state is met once."""
    met: set[tuple[Phase, bool, tuple[str, ...]]] = set()
    edge = [state]
    for time_ns in range(1, depth):
        following: list[StopMachineState] = []
        for one in edge:
            for event in _events(one, 1000 * time_ns):
                after = step(one, event)
                yield one, event, after
                key = (after.state.phase, after.state.number == one.number, tuple(after.state.disturbed_ns))
                if key not in met:
                    met.add(key)
                    following.append(after.state)
        edge = following


def _events(state: StopMachineState, now_ns: int) -> Iterator[Event]:
    fresh = {name: ResetFinding(at_rest=True, asked_ns=now_ns) for name in TARGETS}
    for what in Input:
        for number in (state.number, state.number - 1):
            for standing in ((), ("rule",)):
                for findings in ({}, fresh):
                    yield Event(what, now_ns, "left_knee", number, standing, findings)


def test_no_order_of_events_lets_go_of_a_hold_without_proof() -> None:
    tried = 0
    for before, event, after in orders(StopMachineState(TARGETS), depth=12):
        tried += 1
        if before.held and not after.state.held:
            assert (before.phase, event.input) == (Phase.RELEASING, Input.REMOVED)
        if before.phase is not Phase.RELEASING and after.state.phase is Phase.RELEASING:
            assert event.input is Input.PROVED
            assert not event.standing
            assert not list(unproved(before, event.findings))
        if Action.RAISE in after.actions:
            assert not before.held
        if event.input in STOPS:
            assert Action.STOP_ALL in after.actions
        assert after.state.number - before.number in (0, 1)
        assert after.state.stops >= before.stops
    assert tried > 1000


def test_every_phase_can_be_left_and_reached() -> None:
    reached = {phase for rows in TRANSITIONS.values() for phase, _actions in rows.values()}
    assert reached == set(Phase) == set(TRANSITIONS)


def test_the_table_in_the_docs_is_the_one_of_the_code() -> None:
    text = Path("docs/explanation/stop.md").read_text(encoding="utf-8")
    assert table() in text
