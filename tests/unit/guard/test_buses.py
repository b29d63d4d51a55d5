"""What a node takes to answer, whether a bus is there at all, and whether SYNC comes in time."""

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import cast

import pytest

from drivers.bus.bus import BusUser
from drivers.bus.interfaces.controller_state import BusState
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from gateway.guard.buses import BusWatcher, SyncWatcher
from gateway.guard.inputs import AGAIN_NS
from gateway.guard.watcher import GRACE_NS
from gateway.guard.watcher import RuleState as Found
from gateway.guard.watchers import ASK_S, UNASKED_NS
from tests.unit.guard.bench import Bench, S

MS = 1_000_000


@pytest.fixture
def asked(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[float, Exception | None], None]]:
    """The controller is asked, and answers after so long (s)."""
    wiring = bench.wire("sdo_latency", on=["gait"], above=0.1, clear_s=0.1)
    wiring.open()
    assert [period_s for period_s, _job in bench.gait.worker.repeated] == [ASK_S]
    began = time.monotonic_ns()

    def ask(took_s: float, answer: Exception | None = None) -> None:
        stamps = iter((began, began + round(took_s * S)))
        monkeypatch.setattr("gateway.guard.watchers.time", SimpleNamespace(monotonic_ns=lambda: next(stamps)))
        bench.gait.worker.answer = answer
        bench.gait.worker.ask()

    yield ask
    wiring.close()
    assert not bench.gait.worker.repeated


@pytest.mark.parametrize(
    ("took_s", "answer", "reasons"),
    [
        (0.1, None, []),
        (0.101, None, ["gait: answered after 0.101 s, above 0.1 s"]),
        (0.05, DeviceAbort("no such object", 0x0602_0000), []),
        (0.2, DeviceAbort("no such object", 0x0602_0000), ["gait: answered after 0.2 s, above 0.1 s"]),
        (0.05, DeviceTimeout("silence"), ["gait: no answer"]),
    ],
)
def test_a_node_that_answers_late_or_not_at_all_trips(
    bench: Bench,
    asked: Callable[[float, Exception | None], None],
    took_s: float,
    answer: Exception | None,
    reasons: list[str],
) -> None:
    asked(took_s, answer)
    assert [one.reason for one in bench.changes] == reasons


def test_nobody_knows_how_long_an_answer_takes_that_cannot_be_asked_for(
    bench: Bench, asked: Callable[[float, Exception | None], None]
) -> None:
    with pytest.raises(Unavailable):
        asked(0.1, Unavailable("the bus is not open"))
    assert not bench.changes


def test_a_node_that_comes_up_is_not_asked(
    bench: Bench, asked: Callable[[float, Exception | None], None]
) -> None:
    bench.gait.node.ready = False
    asked(9.0, DeviceTimeout("silence"))
    assert not bench.changes
    bench.gait.node.ready = True
    asked(9.0, None)
    assert bench.states() == [Found.TRIPPED]


def test_a_latency_is_unknown_when_it_was_not_seen_for_long(bench: Bench) -> None:
    wiring = bench.wire("sdo_latency", on=["gait"], above=0.1)
    (watcher,) = wiring.watchers
    wiring.open()
    before_ns = time.monotonic_ns()
    bench.gait.worker.ask()
    wiring.close()
    assert watcher.look(before_ns + UNASKED_NS) <= time.monotonic_ns() + UNASKED_NS + 1
    assert not bench.changes
    watcher.look(time.monotonic_ns() + UNASKED_NS + 1)
    assert bench.states() == [Found.BLIND]


def test_a_bus_brings_its_life_and_its_sync_to_their_rules_between_open_and_close(bench: Bench) -> None:
    bus = bench.buses["main"]
    life = bench.wire("bus", on=["main"])
    sync = bench.wire("sync_lost", on=["main"], period_s=0.1, tolerance_s=0.1, can_id=0x90)
    for wiring in (life, sync):
        wiring.open()
    handler = bus._handlers[0x90]
    handler(S, b"")
    handler(S + 200_000_000, b"")
    assert not bench.changes
    handler(S + 400_000_001, b"")
    assert [one.reason for one in bench.changes] == ["main: SYNC came after 0.200 s"]
    assert bus._users == (cast("BusUser", life.watchers[0]),)
    for wiring in (life, sync):
        wiring.close()
    assert not bus._handlers
    assert not bus._users


@pytest.fixture
def life(bench: Bench) -> BusWatcher:
    """A bus that must not be silent for longer than 0.2 s."""
    (watcher,) = bench.wire("bus", on=["main"], silent_s=0.2, clear_s=0.1).watchers
    assert isinstance(watcher, BusWatcher)
    watcher.bus_opened()
    return watcher


def test_a_bus_is_silent_when_its_time_is_over_and_not_before(bench: Bench, life: BusWatcher) -> None:
    bench.buses["main"].frames += 1
    assert life.look(10 * S) == 10 * S + AGAIN_NS
    life.tick(10 * S + 200 * MS)
    assert not bench.changes
    life.tick(10 * S + 201 * MS)
    assert [one.reason for one in bench.changes] == ["main: no frame for 0.20 s"]
    for at_ms in (300, 399):
        bench.buses["main"].frames += 1
        life.tick(10 * S + at_ms * MS)
    assert bench.states() == [Found.TRIPPED]
    life.tick(10 * S + 400 * MS)
    assert bench.states() == [Found.TRIPPED, Found.CLEARED]


def test_a_bus_that_was_never_heard_is_blind_and_not_lost(bench: Bench, life: BusWatcher) -> None:
    life.look(GRACE_NS)
    assert not bench.changes
    life.look(GRACE_NS + 1)
    life.bus_closed()
    assert [(one.state, one.reason) for one in bench.changes] == [
        (Found.BLIND, "main: no frame has come yet")
    ]


def test_a_bus_that_cannot_be_opened_says_why(bench: Bench, life: BusWatcher) -> None:
    bench.buses["main"].problem = "interface can0 is down"
    life.look(GRACE_NS + 1)
    assert [one.reason for one in bench.changes] == ["main: interface can0 is down"]


def test_a_bus_that_goes_trips_at_once_and_is_well_when_it_is_heard_again(
    bench: Bench, life: BusWatcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    bus = bench.buses["main"]
    bus.frames += 1
    life.tick(10 * S)
    bus.problem = "interface can0 is gone"
    monkeypatch.setattr("gateway.guard.buses.time", SimpleNamespace(monotonic_ns=lambda: 10 * S + 1))
    life.bus_closed()
    assert [one.reason for one in bench.changes] == ["main: is gone: interface can0 is gone"]
    life.bus_opened()
    life.tick(11 * S)
    life.tick(11 * S + 200 * MS)
    assert bench.states() == [Found.TRIPPED], "open, and nothing was heard since"
    for at_ms in (300, 400):
        bus.frames += 1
        life.tick(11 * S + at_ms * MS)
    assert bench.states() == [Found.TRIPPED, Found.CLEARED]


@pytest.mark.parametrize(
    ("state", "reasons"),
    [
        (BusState.ACTIVE, []),
        (BusState.WARNING, []),
        (BusState.PASSIVE, ["main: our CAN controller is error passive"]),
        (BusState.OFF, ["main: our CAN controller is bus off"]),
    ],
)
def test_a_controller_that_hardly_takes_part_trips_heard_or_not(
    bench: Bench, life: BusWatcher, state: BusState, reasons: list[str]
) -> None:
    bench.buses["main"].health.state = state
    life.tick(S)
    assert [one.reason for one in bench.changes] == reasons


def test_sync_that_stays_away_is_seen_by_who_looks(bench: Bench) -> None:
    (watcher,) = bench.wire("sync_lost", on=["main"], period_s=0.1, tolerance_s=0.1, clear_s=0.1).watchers
    assert isinstance(watcher, SyncWatcher)
    watcher.on_frame(10 * S, b"")
    assert watcher.look(10 * S + 1) == 10 * S + 200 * MS + 1
    watcher.look(10 * S + 200 * MS)
    assert not bench.changes
    watcher.look(10 * S + 200 * MS + 1)
    assert [one.reason for one in bench.changes] == ["main: silent for 0.20 s"]
    watcher.on_frame(10 * S + 300 * MS, b"")
    watcher.look(10 * S + 300 * MS)
    watcher.look(10 * S + 399 * MS)
    assert bench.states() == [Found.TRIPPED]
    watcher.look(10 * S + 400 * MS)
    assert bench.states() == [Found.TRIPPED, Found.CLEARED]


def test_sync_that_was_never_heard_is_blind(bench: Bench) -> None:
    (watcher,) = bench.wire("sync_lost", on=["main"], period_s=0.1).watchers
    watcher.look(GRACE_NS + 1)
    assert [(one.state, one.reason) for one in bench.changes] == [
        (Found.BLIND, "main: has not been heard yet")
    ]
