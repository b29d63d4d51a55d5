"""Short attacks: whoever stops is never refused, and nobody but the attacker loses anything.

How soon a stop acts, heartbeats and memory are measured by `./dev attack`: they depend on the machine.
"""

import dataclasses
import itertools
import random
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hil_sim.sensors.suite import SensorChoice
from tests.attack import on_bus, robot_attack, strangers
from tests.attack.attack import DeviceAttack, Strike
from tests.attack.barrage import PRINTED, Manner, Said, Target, barrage, printable, request
from tests.attack.calls import NAMES
from tests.attack.robot import Robot, robot
from tests.attack.robot_attack import Phase, Stopping
from tests.attack.table import ATTACKS, MODULES
from tests.support.waiting import until
from tests.unit.gateway.harness import Client

RATE = 200.0  # TPDOs a second, for slow machines
SECONDS = 0.25
NODES = tuple(range(1, 9))
LONGEST_NAME = 1000  # characters, of whatever a client calls itself; no limit need be so wide


@pytest.fixture(scope="module")
def victim(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    with robot(tmp_path_factory.mktemp("attacked"), SensorChoice("witmotion", "insole-csv"), RATE) as made:
        yield made


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    """No slow machine is a refusal."""
    monkeypatch.setattr(robot_attack, "PATIENCE_S", 20.0)


def stopped(victim: Robot, nodes: tuple[int, ...] = NODES) -> Phase:
    stopping = Stopping(victim, nodes)
    try:
        return stopping.measure(SECONDS)
    finally:
        stopping.close()


def struck(victim: Robot, name: str) -> tuple[Phase, Said]:
    """What is measured during the attack, and what the attacker was told."""
    strike, said = ATTACKS[name], []
    assert isinstance(strike, Strike)
    target = Target(victim.address, SECONDS)
    attacker = threading.Thread(target=lambda: said.append(strike.run(target)), name=f"attacker {name}")
    attacker.start()
    try:
        phase = stopped(victim)
    finally:
        attacker.join()
    return phase, said[0]


def assert_unharmed(phase: Phase) -> None:
    assert phase.refused == []
    assert phase.stops_ms
    assert (phase.streams["ended"], phase.streams["gaps"]) == (0, 0)


def assert_nothing_answered(said: Said) -> None:
    """Who speaks another protocol is ended, too."""
    assert not said.answered
    assert said.ended


def test_a_web_page_changes_no_parameter(tmp_path: Path) -> None:
    """First, before there is the robot of the others."""
    with robot(tmp_path, rate=RATE) as walking:  # nobody has stopped it: a write would be done
        barrage(Target(walking.address, SECONDS), 1, Manner(strangers.HTTP, pause_s=0.3))
        assert walking.bus.wrote == 0


@pytest.mark.parametrize("name", ["idle", "slow-loris", "odd-numbers", "tls", "ssh"])
def test_who_says_little_costs_nobody_a_stop_or_a_row(victim: Robot, name: str) -> None:
    phase, said = struck(victim, name)
    assert_unharmed(phase)
    assert phase.lost == 0
    assert said.text
    if name in ("tls", "ssh"):
        assert_nothing_answered(said)


@pytest.mark.parametrize("name", ["newlines", "nested", "long-line", "stops", "ones-16"])
def test_who_says_much_costs_nobody_a_stop_or_the_stream(victim: Robot, name: str) -> None:
    phase, _ = struck(victim, name)
    assert_unharmed(phase)


@pytest.mark.parametrize("name", ["sdo-answers", "life-noise"])
def test_every_drive_that_is_not_to_blame_is_stopped(victim: Robot, name: str) -> None:
    attack = ATTACKS[name]
    assert isinstance(attack, DeviceAttack)
    victim.bus.say(f"hostile {name}")
    try:
        phase = stopped(victim, attack.nodes)
    finally:
        victim.bus.say("hostile none")
    assert phase.refused == []
    assert phase.streams["ended"] == 0


def test_a_hostile_sensor_harms_no_other_and_is_taken_up_again(victim: Robot) -> None:
    with Client(victim.address) as client:

        def state(name: str) -> Any:
            return client.call("component.snapshot")["quality"][name]["state"]

        victim.sensors.say("hostile left_insole")
        assert_unharmed(stopped(victim))
        assert state("trunk") == state("right_insole") == "ok"
        victim.sensors.say("hostile none")
        until(lambda: state("left_insole") == "ok", "the insole is heard again")


def test_who_speaks_http_is_answered_nothing_and_ended(victim: Robot) -> None:
    _, said = struck(victim, "http")
    assert_nothing_answered(said)


def test_nobody_is_shown_a_name_without_end(victim: Robot) -> None:
    with Client(victim.address) as named, Client(victim.address) as other:
        named.send(NAMES.splitlines(keepends=True)[0] + request("clock.read", number=2))
        named.line()
        named.line()
        costs = other.call("gateway.cost")["clients"]
        assert max(len(one["who"]) for one in costs) <= LONGEST_NAME


# The instrument itself


def test_every_attack_has_a_name_of_its_own() -> None:
    assert len(ATTACKS) == sum(len(module) for module in MODULES)
    assert all(attack.name == name and attack.about for name, attack in ATTACKS.items())


def test_what_an_attacker_was_told_fits_into_a_row() -> None:
    assert printable("a\x1b[2J\n" + "b" * 100) == ("a·[2J·" + "b" * 100)[:PRINTED]


def test_each_limit_is_judged() -> None:
    well = Phase(
        stops_ms=[1.0],
        guard_ms=[5.0],
        gap_ms=101.0,
        streams={"lost": 0, "gaps": 0, "ended": 0},
    )
    memory = (40.0, 90.0, 47.0)
    assert list(robot_attack._broken(19.0, well, memory)) == []
    assert list(robot_attack._broken(float("nan"), well, memory)) == ["stop"]
    assert list(robot_attack._broken(0.0, well, (40.0, 90.0, 49.0))) == ["memory"]
    broken: dict[str, dict[str, Any]] = {
        "refused": {"refused": ["closed"]},
        "guard": {"guard_ms": []},
        "heartbeat": {"gap_ms": 251.0},
        "rows": {"streams": {"lost": 1, "gaps": 0, "ended": 0}},
        "streams ended": {"streams": {"lost": 0, "gaps": 0, "ended": 1}},
    }
    for limit, change in broken.items():
        assert list(robot_attack._broken(0.0, dataclasses.replace(well, **change), memory)) == [limit]


def test_a_row_says_what_the_gateway_takes_of_a_core_without_and_under_the_attack(victim: Robot) -> None:
    measured = stopped(victim)
    assert measured.cpu > 0.0
    quiet, attacked = (dataclasses.replace(measured, cpu=share) for share in (0.171, 0.428))
    row = robot_attack._judged("x", quiet, attacked, (40.0, 40.0, 40.0), Said(""))
    assert dict(zip(row.columns, row.cells, strict=True))["CPU %"] == "17/43"
    assert (row.figures["quiet"]["cpu"], row.figures["attacked"]["cpu"]) == (0.171, 0.428)


def test_hostile_frames_are_such_as_a_bus_carries() -> None:
    for name, frames in on_bus.HOSTILE.items():
        found = list(itertools.islice(frames(random.Random(1)), 200))
        assert all(can_id < 1 << 29 and len(data) <= 8 for can_id, data in found), name
