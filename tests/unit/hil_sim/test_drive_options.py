"""Option codes: how a drive comes to rest, and in which state it ends."""

import pytest

from tests.unit.hil_sim.bench import NODE, Bench
from tests.unit.hil_sim.driving import (
    ENABLE,
    HALT,
    POSITION,
    REACHED,
    TORQUE,
    VELOCITY,
    enable_in,
    has,
    move_to,
    position,
    state,
    torque,
    until,
    velocity,
)

SPEED = (
    65_190  # counts/s: 1 rad/s, from which the profile deceleration needs 250 ms and the quick stop 100 ms
)
READY, SWITCHED_ON, ENABLED, STOPPED, DISABLED, FAULT = 0x21, 0x23, 0x27, 0x07, 0x40, 0x08


def moving(bench: Bench, mode: int = POSITION) -> None:
    enable_in(bench, mode)
    assert bench.write(0x6085, 0, 10 * SPEED, 4) == "ok"
    if mode == POSITION:
        move_to(bench, 140_000)
    else:
        assert bench.write(0x60FF, 0, SPEED, 4) == "ok"
    bench.run(600)
    assert velocity(bench) == pytest.approx(SPEED, rel=0.05)


def rest_ms(bench: Bench) -> int:
    """How long the joint still moves."""
    return until(bench, lambda: abs(bench.joint.velocity) < 0.02)


@pytest.mark.parametrize("mode", [POSITION, VELOCITY])
@pytest.mark.parametrize(
    ("option", "end", "least_ms", "most_ms"),
    [
        (1, DISABLED, 200, 300),
        (2, DISABLED, 90, 130),
        (3, DISABLED, 5, 60),
        (5, STOPPED, 200, 300),
        (6, STOPPED, 90, 130),
        (7, STOPPED, 5, 60),
    ],
)
def test_quick_stop_slows_down_and_ends_as_605ah_says(
    bench: Bench, mode: int, option: int, end: int, least_ms: int, most_ms: int
) -> None:
    moving(bench, mode)
    assert bench.write(0x605A, 0, option, 2) == "ok"
    bench.controlword(0x02)
    assert state(bench) == STOPPED
    assert least_ms <= rest_ms(bench) <= most_ms
    bench.run(400)
    assert state(bench) == end
    bench.controlword(ENABLE)
    assert state(bench) == (ENABLED if end == STOPPED else DISABLED)


def test_quick_stop_without_a_ramp_leaves_the_joint_to_its_friction(bench: Bench) -> None:
    moving(bench)
    assert bench.write(0x605A, 0, 0, 2) == "ok"
    bench.controlword(0x02)
    assert state(bench) == DISABLED
    assert torque(bench) == 0
    assert rest_ms(bench) > 50


def test_while_it_stops_with_605ah_of_2_nothing_enables_it_again(bench: Bench) -> None:
    moving(bench)
    assert bench.write(0x605A, 0, 1, 2) == "ok"
    bench.controlword(0x02)
    bench.run(50)
    bench.controlword(ENABLE)
    assert state(bench) == STOPPED
    bench.run(400)
    assert state(bench) == DISABLED


def test_in_quick_stop_active_the_joint_is_held_where_it_came_to_rest(bench: Bench) -> None:
    moving(bench)
    assert bench.write(0x605A, 0, 6, 2) == "ok"
    bench.controlword(0x02)
    bench.run(500)
    assert has(bench, REACHED)
    there = position(bench)
    bench.joint.load = 25.0
    bench.run(500)
    assert position(bench) == pytest.approx(there, abs=700)


@pytest.mark.parametrize(
    ("index", "controlword", "end"), [(0x605B, 0x06, READY), (0x605C, 0x07, SWITCHED_ON)]
)
def test_the_way_out_of_operation_is_at_once_or_by_the_slow_down_ramp(
    bench: Bench, index: int, controlword: int, end: int
) -> None:
    moving(bench)
    assert bench.write(index, 0, 1, 2) == "ok"
    bench.controlword(controlword)
    assert state(bench) == ENABLED  # transitions 5 and 8 come at standstill
    assert 200 <= rest_ms(bench) <= 300
    bench.run(10)
    assert state(bench) == end
    bench.controlword(0x07)
    bench.controlword(ENABLE)
    assert bench.write(index, 0, 0, 2) == "ok"
    bench.controlword(controlword)
    assert state(bench) == end


def test_enable_operation_undoes_a_way_out_that_is_not_over(bench: Bench) -> None:
    moving(bench)
    bench.controlword(0x07)
    bench.run(100)
    bench.controlword(ENABLE)
    bench.run(1000)
    assert state(bench) == ENABLED
    assert bench.joint.velocity == pytest.approx(0.0, abs=0.01)
    move_to(bench, 0)
    until(bench, lambda: has(bench, REACHED))
    assert position(bench) == pytest.approx(0, abs=500)  # 6067h


def test_a_quick_stop_overtakes_a_slow_way_out(bench: Bench) -> None:
    moving(bench)
    bench.controlword(0x07)
    bench.run(20)
    bench.controlword(0x02)
    assert state(bench) == STOPPED
    assert rest_ms(bench) < 130


@pytest.mark.parametrize("mode", [POSITION, VELOCITY])
@pytest.mark.parametrize(("option", "least_ms", "most_ms"), [(1, 200, 300), (2, 90, 130), (3, 5, 60)])
def test_halt_stops_as_605dh_says_and_motion_goes_on_after_it(
    bench: Bench, mode: int, option: int, least_ms: int, most_ms: int
) -> None:
    moving(bench, mode)
    assert bench.write(0x605D, 0, option, 2) == "ok"
    bench.controlword(ENABLE | HALT)
    assert least_ms <= rest_ms(bench) <= most_ms
    until(bench, lambda: has(bench, REACHED))
    assert state(bench) == ENABLED
    bench.controlword(ENABLE)
    bench.run(600)
    assert velocity(bench) == pytest.approx(SPEED, rel=0.05)


@pytest.mark.parametrize(("option", "least_ms", "most_ms"), [(1, 200, 300), (2, 90, 130), (3, 5, 60)])
def test_the_reaction_to_a_fault_is_what_605eh_says(
    bench: Bench, option: int, least_ms: int, most_ms: int
) -> None:
    moving(bench)
    assert bench.write(0x605E, 0, option, 2) == "ok"
    bench.drive.fault(0xFF01)
    assert state(bench) == 0x0F
    assert least_ms <= rest_ms(bench) <= most_ms
    until(bench, lambda: state(bench) == FAULT, at_most_ms=50)
    assert bench.read(0x603F) == 0xFF01


def test_a_fault_without_reaction_or_without_a_power_stage_lets_go_at_once(bench: Bench) -> None:
    moving(bench)
    bench.drive.fault(0x2310)
    assert state(bench) == FAULT
    bench.controlword(0x80)
    assert state(bench) == DISABLED
    assert bench.write(0x605E, 0, 0, 2) == "ok"
    bench.run(1000)
    bench.enable()
    bench.drive.fault(0xFF01)
    assert state(bench) == FAULT


def test_a_reaction_that_cannot_stop_the_joint_is_given_up(bench: Bench) -> None:
    enable_in(bench, TORQUE)
    assert bench.write(0x6072, 0, 100, 2) == "ok"
    bench.joint.load = 60.0  # more than the motor may hold
    bench.run(100)
    bench.drive.fault(0xFF01)
    assert state(bench) == 0x0F
    until(bench, lambda: state(bench) == FAULT, at_most_ms=1500)


@pytest.mark.parametrize(("option", "end"), [(0, ENABLED), (1, FAULT), (2, DISABLED), (3, DISABLED)])
@pytest.mark.parametrize("by", ["nmt stop", "heartbeat"])
def test_lost_communication_does_what_6007h_says(bench: Bench, by: str, option: int, end: int) -> None:
    bench.start()
    assert bench.write(0x6007, 0, option, 2) == "ok"
    assert bench.write(0x1016, 1, 0x10 << 16 | 50, 4) == "ok"
    bench.enable()
    if by == "heartbeat":
        bench.send(0x710, "05")
    else:
        bench.send(0x000, f"02 {NODE:02X}")
    bench.run(200)
    bench.send(0x000, f"80 {NODE:02X}")
    assert state(bench) == end
    assert bench.read(0x603F) == (0x8100 if end == FAULT else 0)


@pytest.mark.parametrize(
    ("index", "offered"),
    [
        (0x6007, (0, 1, 2, 3)),
        (0x605A, (0, 1, 2, 3, 5, 6, 7)),
        (0x605B, (0, 1)),
        (0x605C, (0, 1)),
        (0x605D, (1, 2, 3)),
        (0x605E, (0, 1, 2, 3)),
    ],
)
def test_options_that_the_drive_has_not_are_refused(
    bench: Bench, index: int, offered: tuple[int, ...]
) -> None:
    bench.boot()
    taken = tuple(value for value in range(-1, 9) if bench.write(index, 0, value, 2) == "ok")
    assert taken == offered
