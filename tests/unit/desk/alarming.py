"""A desk's robot that walks, and what can be wrong with it."""

import time

import pytest

from gateway.client import ConnectionState
from gateway.wire.stop import Stopped
from server_gui.core.alarms.texts import Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Event, LinkChanged
from tests.support.desk import JOINTS, Bench, described, looked, telemetry, walking

CAUSE = "0x2310 continuous overcurrent at the output (register: generic, current)"
ALL = Stopped(dict.fromkeys(JOINTS, "confirmed"), held=True)


def walking_bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A desk with a robot that walks; what it has said gets old in a minute, on a busy computer as well."""
    monkeypatch.setattr("server_gui.core.follow.robot.STALE_NS", 60_000_000_000)
    made = Bench(Desk())
    made.add("exo-01").take([described(), walking(50), looked()])
    return made


def link_lost(bench: Bench) -> None:
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])


def states(number: float, **others: float) -> Event:
    """A row, just now, with every drive in this state but these."""
    now_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {
        f"{joint}.state": [others.get(joint, number)] for joint in JOINTS
    }
    return telemetry([now_ns], columns, now_ns)


def kinds(station: Station) -> list[Kind]:
    return [one.alarm.kind for one in station.alarms.active]


def fault(station: Station) -> None:
    station.take(
        [states(5.0, left_knee=7.0), looked(state="fault", problem=f"the drive is in fault: {CAUSE}")]
    )
