"""Where a computer is overloaded, what is silent or stale sends nobody to cables first."""

import dataclasses
from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from server_gui.core.alarms.overload import BOTH, OURS, THEIRS
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.own_load import EVERY_S, LASTS_S, OLD_S, OwnLoad
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Looked, Resources
from tests.support.desk import JOINTS, Bench, described, looked, resources, walking

CABLE = check_of(Kind.LOST, "joint")


@pytest.fixture
def station(monkeypatch: pytest.MonkeyPatch) -> Station:
    """A robot that walks; its left knee is lost."""
    for name in ("STALE_NS", "BUSY_NS"):
        monkeypatch.setattr(f"server_gui.core.follow.robot.{name}", 60_000_000_000)
    station = Bench(Desk()).add("exo-01")
    station.take([described(), walking(50), looked(state="lost", problem="no heartbeat")])
    return station


PARTS = ["gait", "left_insole", "right_insole", "trunk", *JOINTS]


def all_lost() -> Looked:
    """Return that nothing comes from any device."""
    one = looked(state="lost", problem="no heartbeat")
    quality = dict.fromkeys(PARTS, one.quality.quality["left_knee"])
    return dataclasses.replace(one, quality=replace(one.quality, quality=quality))


def busy(percent: float) -> Resources:
    seen = resources()
    snapshot = replace(seen.snapshot, cpu=replace(seen.snapshot.cpu, percent=percent))
    return dataclasses.replace(seen, snapshot=snapshot)


def check(station: Station) -> str:
    return next(one.alarm.check for one in station.alarms.active if one.alarm.kind is Kind.LOST)


@pytest.mark.parametrize(
    ("percent", "is_ours", "first"),
    [(21.5, False, ()), (97.0, False, (THEIRS,)), (21.5, True, (OURS,)), (97.0, True, (BOTH,))],
)
def test_an_overloaded_computer_is_said_before_the_cable_of_what_is_not_the_only_one(
    station: Station, percent: float, is_ours: bool, first: tuple[str, ...]
) -> None:
    """A load makes all of them late: of one node among well ones its cable is looked at first."""
    station.take([busy(percent)])
    station.is_overloaded = lambda: is_ours
    assert check(station) == "; also ".join((CABLE, *(one.replace(" first", "") for one in first)))
    station.take([all_lost()])
    checks = [one.alarm.check for one in station.alarms.active if one.alarm.kind is Kind.LOST]
    assert checks
    assert all(one.startswith("; then ".join(first)) for one in checks)


def test_no_load_is_blamed_for_a_port_that_is_gone(station: Station) -> None:
    station.is_overloaded = lambda: True
    station.take([looked(state="lost", problem="/dev/ttyUSB0 does not exist: plug the device in")])
    assert check(station) == "plug the device in"


def test_a_fault_is_not_said_to_come_from_a_busy_computer(station: Station) -> None:
    station.is_overloaded = lambda: True
    station.take([looked(state="fault", problem="the drive is in fault: 0x2310 overcurrent")])
    assert OURS not in str([one.alarm for one in station.alarms.active])


def test_a_load_that_was_seen_long_ago_is_not_known(
    station: Station, monkeypatch: pytest.MonkeyPatch
) -> None:
    station.take([busy(97.0)])
    monkeypatch.setattr("server_gui.core.follow.robot.BUSY_NS", 0)
    assert check(station) == CABLE


# --- this computer's own


def told(readings: Sequence[str], step_s: float = EVERY_S) -> list[bool]:
    """What is said at each reading of /proc/stat."""
    lines, times = iter(readings), iter(place * step_s for place in range(len(readings)))
    load = OwnLoad(lambda: next(lines), lambda: next(times))
    return [load.is_overloaded() for _ in readings]


def stat(busy_ticks: int, idle_ticks: int) -> str:
    return f"cpu  {busy_ticks} 0 0 {idle_ticks} 0 0 0 0 0 0\n"


def test_it_is_overloaded_while_nine_tenths_of_its_time_are_taken_and_a_little_longer() -> None:
    readings = [stat(0, 0), stat(90, 110), stat(180, 120), *[stat(180, 320 + 200 * n) for n in range(8)]]
    said = told(readings)
    assert said[:3] == [False, False, True]
    assert said[3:] == [place * EVERY_S <= LASTS_S for place in range(1, 9)]


def test_it_is_full_after_seconds_of_it_until_it_is_not_overloaded_any_more() -> None:
    taken = [100, 100, 94, 100, 100, 100, 92, 92, *[50] * 7]  # percent of each second
    times = [sum(taken[:place]) for place in range(len(taken) + 1)]
    lines = iter([stat(busy, 100 * place - busy) for place, busy in enumerate(times)])
    clock = iter(place * EVERY_S for place in range(len(times)))
    load = OwnLoad(lambda: next(lines), lambda: next(clock))
    said = [load.is_full() for _ in times]
    begins, ends = said.index(True), len(said) - said[::-1].index(True)
    assert begins == 6, "the third full second in a row"
    assert ends == 8 + 1 + LASTS_S / EVERY_S
    assert all(said[begins:ends])


@pytest.mark.parametrize("line", ["", "cpu one two\n", "intr 5\n"])
def test_where_nothing_is_told_nothing_is_overloaded(line: str) -> None:
    assert told([line] * 4) == [False] * 4


def test_what_was_read_long_ago_says_nothing_of_now() -> None:
    assert told([stat(0, 0), stat(5000, 0)], step_s=OLD_S + 1) == [False, False]


def test_a_file_that_cannot_be_read_is_no_load() -> None:
    def read() -> str:
        raise OSError

    assert not OwnLoad(read).is_overloaded()
