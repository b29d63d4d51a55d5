"""What the journal shows to be stored, and everything that makes it unknown again."""

import time

import pytest

from gateway.client import ConnectionState
from gateway.wire.component import QualityInfo, Snapshot
from server_gui.core.follow.events import LinkChanged, Looked
from tests.support.desk import HELD, Bench, described, looked, telemetry
from tests.support.journals import RobotsJournal

STEP = "gait.step_length"


def seen(boots: int = 0, **more: object) -> Looked:
    """A look at the gait controller and the left knee."""
    life: QualityInfo = {"state": "ok", "boots": boots, "bus_opened": 1, "bus_dropped": 0}
    life |= {name: value for name, value in more.items() if isinstance(value, str | int)}
    return Looked(
        Snapshot(0, {}, {}, {"gait": life, "left_knee": life}), looked().parameters, time.monotonic_ns()
    )


def store(journal: RobotsJournal, component: str = "gait") -> None:
    journal.say("store", component=component)
    journal.say("store done", component=component, result="stored")


@pytest.fixture
def watched(bench: Bench) -> Bench:
    """The robot's clock is known, and its devices have been seen."""
    bench.station.take([telemetry([time.monotonic_ns()], {"gait.x": [0.0]}), seen()])
    return bench


def test_a_value_that_was_stored_after_its_last_write_is_stored(
    watched: Bench, journal: RobotsJournal
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP)
    store(journal)
    watched.station.take([journal.told(), seen()])
    assert watched.station.is_stored(STEP)
    assert not watched.station.is_stored("gait.trunk_angle"), "nobody wrote it: what was stored is not known"
    assert not watched.station.is_stored("left_knee.max_torque")


@pytest.mark.parametrize(
    ("name", "then"),
    [
        ("another write", lambda journal: journal.written({STEP: 0.4}, {STEP: 0.41})),
        ("a write of the same value", lambda journal: journal.written({STEP: 0.41}, {STEP: 0.4})),
        ("a trial", lambda journal: journal.written({STEP: 0.4}, {STEP: 0.41}, "trial begun")),
        (
            "a write without an end",
            lambda journal: journal.say("write", write=9, before={}, after={STEP: 0.4}),
        ),
        ("a store that failed", lambda journal: journal.say("store FAILED", component="gait", result="?")),
        ("defaults", lambda journal: journal.say("restore done", component="gait", result="at reset")),
    ],
)
def test_what_came_after_a_store_makes_it_unknown(
    watched: Bench, journal: RobotsJournal, name: str, then: object
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told()])
    assert watched.station.is_stored(STEP)
    assert callable(then)
    then(journal)
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP), name


@pytest.mark.parametrize("more", [{"boots": 1}, {"bus_opened": 2}, {"state": "lost"}])
def test_a_boot_up_or_what_may_have_hidden_one_makes_it_unknown(
    watched: Bench, journal: RobotsJournal, more: dict[str, int]
) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told(), seen(**more), seen()])
    assert not watched.station.is_stored(STEP)


def test_a_store_from_before_this_link_is_not_believed(watched: Bench, journal: RobotsJournal) -> None:
    journal.written({STEP: 0.3}, {STEP: HELD[STEP]})
    store(journal)
    watched.station.take([journal.told()])
    assert watched.station.is_stored(STEP)
    for state in (ConnectionState.WAITING, ConnectionState.CONNECTED):
        watched.station.take([LinkChanged(state, None, time.monotonic_ns())])
    watched.station.take([described(), seen()])
    assert not watched.station.is_stored(STEP)


def test_another_value_than_was_stored_is_not_called_stored(watched: Bench, journal: RobotsJournal) -> None:
    journal.written({STEP: 0.3}, {STEP: 0.35})  # and then somebody else has changed it, past the gateway
    store(journal)
    watched.station.take([journal.told()])
    assert not watched.station.is_stored(STEP)
