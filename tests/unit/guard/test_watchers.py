"""One input of one rule: when it trips, when that is over, and what it makes of not seeing anything."""

import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.bus.emcy import Emcy
from gateway.config.guard_rules import Blind, EmcyRule, LevelRule, SilenceRule
from gateway.guard.inputs import (
    AGAIN_NS,
    EmcyWatcher,
    LevelWatcher,
    Pulse,
    SilenceWatcher,
    UnseenWatcher,
)
from gateway.guard.thresholds import Beside, judging
from gateway.guard.watcher import GRACE_NS, RuleState, RuleTransition, Watcher

WATCHING, CLEARED, BLIND, TRIPPED = RuleState.WATCHING, RuleState.CLEARED, RuleState.BLIND, RuleState.TRIPPED
MS, S = 1_000_000, 1_000_000_000
STALE_NS = 500 * MS
BEGAN_NS = 300 * MS


@pytest.fixture
def changes() -> list[RuleTransition]:
    return []


@pytest.fixture
def changed(changes: list[RuleTransition]) -> Callable[[Watcher, RuleTransition], None]:
    return lambda _watcher, change: changes.append(change)


def level(changed: Callable[[Watcher, RuleTransition], None], began_ns: int = 0, **more: Any) -> LevelWatcher:
    """Above 10 A, over below 9 A."""
    rule = LevelRule(watch="current", above=10.0, hysteresis=1.0, clear_s=0.2, **more)
    how = judging(rule, Beside(STALE_NS / 1e9))
    return LevelWatcher(rule, "knee", "knee.current", began_ns, changed, judging=how, stale_ns=STALE_NS)


class TestLevel:
    def test_the_first_frame_above_trips_once_and_says_what_it_saw(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        watcher = level(changed)
        for at, value in enumerate((9.99, 10.0, -10.001, 10.5, 12.0)):
            watcher.see(at * MS, value)
        assert [(one.state, one.stamp_ns, one.acts) for one in changes] == [(TRIPPED, 2 * MS, True)]
        assert changes[0].reason == "knee.current: -10 A, above 10 A"
        assert watcher.trips == 1

    @pytest.mark.parametrize(("last_ms", "trips"), [(99, 0), (100, 1)])
    def test_it_must_last_as_long_as_it_says(
        self, changed: Callable[[Watcher, RuleTransition], None], last_ms: int, trips: int
    ) -> None:
        watcher = level(changed, for_s=0.1)
        for at_ms in (0, 50, last_ms):
            watcher.see((1000 + at_ms) * MS, 11.0)
        assert watcher.trips == trips

    def test_a_value_that_is_well_in_between_begins_anew(
        self, changed: Callable[[Watcher, RuleTransition], None]
    ) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns, for_s=0.1)
        for at_ms, value in ((0, 11.0), (60, 9.0), (70, 11.0), (160, 11.0)):
            watcher.see(now_ns + at_ms * MS, value)
        assert watcher.state is WATCHING
        watcher.see(now_ns + 170 * MS, 11.0)
        assert watcher.state is TRIPPED

    @pytest.mark.parametrize(("value", "last_ms", "state"), [
        (9.0, 199, TRIPPED), (9.0, 200, CLEARED), (9.01, 200, TRIPPED),
    ])  # fmt: skip
    def test_it_is_over_after_a_while_below_its_hysteresis(
        self, changed: Callable[[Watcher, RuleTransition], None], value: float, last_ms: int, state: RuleState
    ) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns)
        watcher.see(now_ns, 11.0)
        for at_ms in (0, 100, last_ms):
            watcher.see(now_ns + (10 + at_ms) * MS, value)
        assert watcher.state is state

    def test_it_trips_anew_after_it_was_over(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns)
        for at_ms, value in ((0, 11.0), (10, 1.0), (210, 1.0), (220, 11.0)):
            watcher.see(now_ns + at_ms * MS, value)
        assert [one.state for one in changes] == [TRIPPED, CLEARED, TRIPPED]
        assert watcher.trips == 2

    def test_silence_makes_it_blind_and_a_live_value_ends_that(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns)
        watcher.see(now_ns, 1.0)
        due_ns = watcher.look(now_ns + STALE_NS)
        assert (watcher.state, due_ns) == (WATCHING, now_ns + STALE_NS + 1)
        assert watcher.look(due_ns) == due_ns + AGAIN_NS
        watcher.look(due_ns + 1)
        assert [(one.state, one.acts) for one in changes] == [(BLIND, False)]
        assert changes[0].reason == "knee.current: no value for 0.50 s"
        watcher.see(time.monotonic_ns(), 1.0)
        assert watcher.state is WATCHING

    @pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
    def test_what_is_no_number_is_not_seen(
        self, changed: Callable[[Watcher, RuleTransition], None], value: float | None
    ) -> None:
        watcher = level(changed)
        watcher.see(0, 1.0)
        watcher.see(STALE_NS, value)
        watcher.look(STALE_NS + 1)
        assert watcher.state is BLIND

    @pytest.mark.parametrize(("age_ns", "state"), [(STALE_NS, WATCHING), (STALE_NS + 1, BLIND)])
    def test_a_value_is_late_when_it_is_older_than_it_may_be(
        self,
        changed: Callable[[Watcher, RuleTransition], None],
        monkeypatch: pytest.MonkeyPatch,
        age_ns: int,
        state: RuleState,
    ) -> None:
        monkeypatch.setattr("gateway.guard.inputs.time", SimpleNamespace(monotonic_ns=lambda: 100 * S))
        watcher = level(changed)
        watcher.look(100 * S)
        watcher.see(100 * S - age_ns, 1.0)
        assert watcher.state is state

    def test_a_value_that_comes_late_does_not_count_as_seen_but_one_that_is_too_much_does(
        self, changed: Callable[[Watcher, RuleTransition], None]
    ) -> None:
        watcher = level(changed)
        watcher.look(time.monotonic_ns())
        assert watcher.state is BLIND
        late_ns = time.monotonic_ns() - STALE_NS - S
        watcher.see(late_ns, 1.0)
        assert watcher.state is BLIND
        watcher.see(late_ns, 11.0)
        assert watcher.state is TRIPPED
        for at_ms in (0, 100, 200, 300):
            watcher.see(late_ns + at_ms * MS, 1.0)
        assert watcher.state is TRIPPED, "late values end nothing"

    def test_nothing_yet_is_blind_only_after_the_time_to_come_up(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        watcher = level(changed, began_ns=S)
        assert watcher.look(S + GRACE_NS) == S + GRACE_NS + 1
        assert watcher.state is WATCHING
        watcher.look(S + GRACE_NS + 1)
        assert [(one.state, one.reason) for one in changes] == [(BLIND, "knee.current: has had no value yet")]

    def test_a_rule_may_act_where_it_cannot_see(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        watcher = level(changed, blind=Blind.ACT)
        watcher.look(GRACE_NS + 1)
        assert [(one.state, one.acts) for one in changes] == [(TRIPPED, True)]

    def test_blindness_does_not_end_a_trip(self, changed: Callable[[Watcher, RuleTransition], None]) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns)
        watcher.see(now_ns, 11.0)
        watcher.see(now_ns + 10 * MS, 1.0)
        watcher.look(now_ns + 10 * S)
        assert watcher.state is TRIPPED
        watcher.see(now_ns + 10 * S, 1.0)
        assert watcher.state is TRIPPED, "well for clear_s, and seen all the time"
        watcher.see(now_ns + 10 * S + 200 * MS, 1.0)
        assert watcher.state is CLEARED

    def test_blind_after_a_trip_is_cleared_when_it_sees_again(
        self, changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
    ) -> None:
        now_ns = time.monotonic_ns()
        watcher = level(changed, now_ns)
        for at_ms, value in ((0, 11.0), (10, 1.0), (210, 1.0)):
            watcher.see(now_ns + at_ms * MS, value)
        watcher.look(now_ns + 10 * S)
        watcher.see(now_ns + 10 * S, 1.0)
        assert [one.state for one in changes] == [TRIPPED, CLEARED, BLIND, CLEARED]


class Life:
    """Signs of life, by hand."""

    def __init__(self) -> None:
        self.last_ns: int | None = None
        self.timeout_s = 0.25
        self.pulse = Pulse(lambda: self.last_ns, lambda: self.timeout_s)


class TestSilence:
    @pytest.fixture
    def life(self) -> Life:
        return Life()

    @pytest.fixture
    def watcher(self, life: Life, changed: Callable[[Watcher, RuleTransition], None]) -> SilenceWatcher:
        rule = SilenceRule(watch="node_lost", clear_s=0.2)
        return SilenceWatcher(rule, "knee", BEGAN_NS, changed, life.pulse)

    def test_it_trips_when_the_time_is_over_and_not_before(
        self, watcher: SilenceWatcher, life: Life, changes: list[RuleTransition]
    ) -> None:
        life.last_ns = S
        assert watcher.look(S + 100 * MS) == S + 250 * MS + 1
        watcher.look(S + 250 * MS)
        assert watcher.state is WATCHING
        watcher.look(S + 250 * MS + 1)
        assert [(one.state, one.acts) for one in changes] == [(TRIPPED, True)]
        assert changes[0].reason == "knee: silent for 0.25 s"

    def test_it_is_over_when_it_was_heard_for_a_while(self, watcher: SilenceWatcher, life: Life) -> None:
        life.last_ns = S
        watcher.look(2 * S)
        for at_ms, state in ((0, TRIPPED), (100, TRIPPED), (199, TRIPPED), (200, CLEARED)):
            life.last_ns = 3 * S + at_ms * MS
            again_ns = watcher.look(life.last_ns) - life.last_ns
            assert watcher.state is state
            assert again_ns == (AGAIN_NS if state is TRIPPED else 250 * MS + 1)

    def test_a_bus_that_goes_makes_it_lost_as_silence_does(self, watcher: SilenceWatcher, life: Life) -> None:
        life.last_ns = S
        watcher.look(S)
        life.last_ns = None  # nothing is known any more
        watcher.look(S + 250 * MS)
        assert watcher.state is WATCHING
        watcher.look(S + 251 * MS)
        assert watcher.state is TRIPPED

    def test_one_that_was_never_heard_is_blind_and_not_lost(
        self, watcher: SilenceWatcher, life: Life, changes: list[RuleTransition]
    ) -> None:
        due_ns = BEGAN_NS + GRACE_NS
        assert watcher.look(due_ns) == due_ns + AGAIN_NS
        assert watcher.state is WATCHING
        watcher.look(due_ns + 1)
        assert [(one.state, one.reason) for one in changes] == [(BLIND, "knee: has not been heard yet")]
        life.last_ns = 5 * S
        watcher.look(5 * S)
        assert watcher.state is WATCHING

    def test_a_reboot_in_between_is_a_loss(
        self, watcher: SilenceWatcher, life: Life, changes: list[RuleTransition]
    ) -> None:
        watcher.on_boot_up(S)  # it is switched on
        assert not changes
        life.last_ns = S
        watcher.look(S)
        watcher.on_boot_up(S + 1)
        assert [(one.state, one.reason) for one in changes] == [(TRIPPED, "knee: has booted anew")]


class TestEmcy:
    @pytest.fixture
    def life(self) -> Life:
        return Life()

    @pytest.fixture
    def make(
        self, life: Life, changed: Callable[[Watcher, RuleTransition], None]
    ) -> Callable[..., EmcyWatcher]:
        def make(*codes: str) -> EmcyWatcher:
            rule = EmcyRule(watch="emcy", codes=codes or None, clear_s=0.2)
            return EmcyWatcher(rule, "knee", BEGAN_NS, changed, life.pulse, None)

        return make

    @staticmethod
    def emcy(code: int, stamp_ns: int = S) -> Emcy:
        return Emcy(stamp_ns, code, 0, b"")

    @pytest.mark.parametrize(
        ("codes", "code", "trips"),
        [
            ((), 0x1000, 1),
            ((), 0xFF01, 1),
            ((), 0x0000, 0),
            (("0x2",), 0x2310, 1),
            (("0x2",), 0x3210, 0),
            (("0x23",), 0x2310, 1),
            (("0x23",), 0x2210, 0),
            (("0x8611",), 0x8611, 1),
            (("0x8611",), 0x8612, 0),
            (("0x3", "0xfF"), 0xFF01, 1),
        ],
    )
    def test_the_code_must_begin_as_the_rule_says(
        self, make: Callable[..., EmcyWatcher], codes: tuple[str, ...], code: int, trips: int
    ) -> None:
        watcher = make(*codes)
        watcher.on_emcy(self.emcy(code))
        assert watcher.trips == trips

    def test_a_storm_is_one_trip(
        self, make: Callable[..., EmcyWatcher], changes: list[RuleTransition]
    ) -> None:
        watcher = make()
        for at in range(1000):
            watcher.on_emcy(self.emcy(0x2310, S + at))
        assert [(one.state, one.stamp_ns) for one in changes] == [(TRIPPED, S)]
        assert changes[0].reason.startswith("knee: 0x2310 continuous overcurrent")

    def test_it_is_over_when_the_device_took_it_back_for_a_while(
        self, make: Callable[..., EmcyWatcher], life: Life
    ) -> None:
        watcher = make()
        watcher.on_emcy(self.emcy(0x2310))
        life.last_ns = 10 * S
        for at_ms in (0, 100, 200):
            watcher.look(9 * S + at_ms * MS)
        assert watcher.state is TRIPPED
        watcher.on_emcy(self.emcy(0x0000))
        watcher.look(10 * S)
        watcher.look(10 * S + 199 * MS)
        assert watcher.state is TRIPPED
        watcher.look(10 * S + 200 * MS)
        assert watcher.state is CLEARED

    def test_a_reboot_takes_it_back_too(self, make: Callable[..., EmcyWatcher], life: Life) -> None:
        watcher = make()
        watcher.on_emcy(self.emcy(0x2310))
        watcher.on_boot_up(2 * S)
        life.last_ns = 10 * S
        watcher.look(10 * S)
        watcher.look(10 * S + 200 * MS)
        assert watcher.state is CLEARED

    def test_a_silent_node_may_have_any_emergency(self, make: Callable[..., EmcyWatcher], life: Life) -> None:
        watcher = make()
        life.last_ns = S
        due_ns = BEGAN_NS + GRACE_NS
        for at_ns, state in ((due_ns, WATCHING), (due_ns + 1, BLIND)):
            assert watcher.look(at_ns) == at_ns + AGAIN_NS
            assert watcher.state is state
        life.last_ns = 5 * S
        watcher.look(5 * S + 250 * MS)
        assert watcher.state is WATCHING
        watcher.look(5 * S + 251 * MS)
        assert watcher.state is BLIND


def test_what_cannot_be_watched_is_blind_at_once_and_says_why(
    changed: Callable[[Watcher, RuleTransition], None], changes: list[RuleTransition]
) -> None:
    rule = LevelRule(watch="temperature", above=80.0)
    watcher = UnseenWatcher(rule, "knee", 0, changed, "has no temperature")
    assert watcher.look(1) == 1 + GRACE_NS
    watcher.look(2)
    assert [(one.state, one.reason) for one in changes] == [(BLIND, "knee: has no temperature")]
