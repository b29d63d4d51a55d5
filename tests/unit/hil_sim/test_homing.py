"""Homing: where each method finds home, what it shows, and what keeps it from it."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from tests.unit.hil_sim.bench import Bench
from tests.unit.hil_sim.driving import (
    BIT_12,
    BIT_13,
    COUNTS_PER_RADIAN,
    ENABLE,
    HALT,
    HOMED,
    HOMING,
    POSITION,
    REACHED,
    enable_in,
    has,
    move_to,
    position,
    state,
    until,
    velocity,
)

START = 0x10
REVOLUTION = 4096  # counts between two indices
LOW_SWITCH = math.radians(-58.0) * COUNTS_PER_RADIAN
HIGH_SWITCH = math.radians(128.0) * COUNTS_PER_RADIAN
COMPLETE, INTERRUPTED, UNDER_WAY = BIT_12 | REACHED, REACHED, 0


def shown(bench: Bench) -> int:
    return bench.read(0x6041) & (BIT_13 | BIT_12 | REACHED)


def prepare(bench: Bench, method: int, speed: int = 60_000) -> None:
    enable_in(bench, HOMING)
    assert bench.write(0x6098, 0, method, 1) == "ok"
    assert bench.write(0x6099, 1, speed, 4) == "ok"
    assert bench.write(0x6099, 2, 10_000, 4) == "ok"


def home(bench: Bench, method: int) -> float:
    """Run the method; gives the true count at which the drive now counts 0."""
    prepare(bench, method)
    assert shown(bench) == INTERRUPTED
    bench.controlword(ENABLE | START)
    until(bench, lambda: shown(bench) == COMPLETE, at_most_ms=20_000)
    assert has(bench, HOMED)
    return bench.joint.motor_position * COUNTS_PER_RADIAN - position(bench)


def index_above(counts: float) -> int:
    return math.ceil(counts / REVOLUTION) * REVOLUTION


@pytest.mark.parametrize(
    ("method", "expected", "within"),
    [
        (17, LOW_SWITCH, 30),
        (18, HIGH_SWITCH, 30),
        (1, index_above(LOW_SWITCH), 1),
        (2, index_above(HIGH_SWITCH) - REVOLUTION, 1),
        (33, 2 * REVOLUTION, 1),
        (34, 3 * REVOLUTION, 1),
        (35, 10_000, 1),
        (37, 10_000, 1),
    ],
)
def test_each_method_finds_its_home(method: int, expected: float, within: float) -> None:
    bench = Bench(position=10_000 / COUNTS_PER_RADIAN)
    assert home(bench, method) == pytest.approx(expected, abs=within)


def test_a_joint_that_stands_on_the_switch_only_has_to_leave_it() -> None:
    bench = Bench(position=math.radians(-59.0))
    assert home(bench, 17) == pytest.approx(LOW_SWITCH, abs=30)
    assert bench.read(0x60FD) == 0


def test_limit_switches_are_seen_in_the_digital_inputs() -> None:
    for degrees, expected in ((-59.0, 1), (0.0, 0), (129.0, 2)):
        bench = Bench(position=math.radians(degrees))
        bench.boot()
        assert bench.read(0x60FD) == expected


def test_home_counts_as_the_home_offset_and_nothing_moves() -> None:
    bench = Bench(position=0.3)
    prepare(bench, 37)
    bench.write(0x607C, 0, -5_000, 4)
    before = bench.joint.position
    bench.controlword(ENABLE | START)
    bench.run(100)
    assert shown(bench) == COMPLETE
    assert position(bench) == pytest.approx(-5_000, abs=1)
    assert bench.read(0x60F4, signed=True) == pytest.approx(0, abs=1)
    assert bench.joint.position == before


def test_after_homing_positions_count_from_home() -> None:
    bench = Bench(position=0.3)
    home(bench, 37)
    before = bench.joint.position
    bench.controlword(ENABLE)
    bench.write(0x6060, 0, POSITION, 1)
    move_to(bench, 20_000)
    until(bench, lambda: has(bench, REACHED))
    assert bench.joint.position - before == pytest.approx(20_000 / COUNTS_PER_RADIAN, abs=0.01)


def test_while_it_searches_neither_attained_nor_reached_is_shown(bench: Bench) -> None:
    prepare(bench, 17, speed=20_000)
    bench.controlword(ENABLE | START)
    bench.run(500)
    assert shown(bench) == UNDER_WAY
    assert velocity(bench) == pytest.approx(-20_000, rel=0.05)


@pytest.mark.parametrize("word", [ENABLE, ENABLE | START | HALT])
def test_it_is_interrupted_by_its_start_bit_and_by_halt(bench: Bench, word: int) -> None:
    prepare(bench, 17)
    bench.controlword(ENABLE | START)
    bench.run(300)
    bench.controlword(word)
    bench.run(600)
    assert velocity(bench) == 0
    assert shown(bench) == INTERRUPTED
    assert not has(bench, HOMED)


def test_a_search_for_the_index_that_meets_the_end_stop_has_failed() -> None:
    bench = Bench(position=math.radians(-57.99))
    prepare(bench, 33)
    assert index_above(LOW_SWITCH) == index_above(position(bench))  # there is none between
    bench.controlword(ENABLE | START)
    until(bench, lambda: shown(bench) == BIT_13 | REACHED)
    bench.run(100)
    assert velocity(bench) == 0
    assert state(bench) == 0x27
    assert not has(bench, HOMED)


LEFT, RIGHT = math.radians(10.0), math.radians(20.0)  # where the home switch is closed
BELOW, ON, ABOVE = math.radians(-20.0), math.radians(15.0), math.radians(60.0)


@pytest.fixture
def switched() -> Callable[[float], Bench]:
    """A joint with a home switch, whose drive names no methods: it has them all."""

    def make(position: float, home_switch: tuple[float, float] | None = (LEFT, RIGHT)) -> Bench:
        bench = Bench(position=position)
        bench.joint.constants = replace(bench.joint.constants, home_switch=home_switch)
        for number in range(1, 9):
            bench.node.dictionary[0x60E3, number].value = 0
        return bench

    return make


# Where each method finds home (CiA 402-2 §11), without its index: of the switch the edge on this side.
EDGES = {19: LEFT, 20: LEFT, 21: RIGHT, 22: RIGHT, 23: LEFT, 24: LEFT, 25: RIGHT, 26: RIGHT} | {
    27: RIGHT,
    28: RIGHT,
    29: LEFT,
    30: LEFT,
}
REACHES = {19: (BELOW, ON), 20: (BELOW, ON), 21: (ABOVE, ON), 22: (ABOVE, ON)}  # others turn at the limits


@pytest.mark.parametrize("method", EDGES)
def test_the_home_switch_is_found_from_wherever_its_method_can(
    switched: Callable[[float], Bench], method: int
) -> None:
    for start in REACHES.get(method, (BELOW, ON, ABOVE)):
        bench = switched(start)
        assert home(bench, method) == pytest.approx(EDGES[method] * COUNTS_PER_RADIAN, abs=60), start


@pytest.mark.parametrize(("method", "side"), [(3, -1), (4, 1), (5, 1), (6, -1), (7, -1), (9, -1), (14, -1)])
def test_behind_the_edge_of_the_home_switch_the_index_is_home(
    switched: Callable[[float], Bench], method: int, side: int
) -> None:
    bench = switched(ON)
    edge = EDGES[method + 16] * COUNTS_PER_RADIAN
    index = math.floor(edge / REVOLUTION) + (side > 0)
    assert home(bench, method) == pytest.approx(index * REVOLUTION, abs=1)


@pytest.mark.parametrize("method", [19, 23, 27])
def test_a_home_switch_that_is_not_there_is_a_homing_error_at_the_end_of_the_way(
    switched: Callable[..., Bench], method: int
) -> None:
    bench = switched(ON, None)
    prepare(bench, method)
    bench.controlword(ENABLE | START)
    until(bench, lambda: shown(bench) == BIT_13 | REACHED, at_most_ms=40_000)
    assert state(bench) == 0x27
    assert not has(bench, HOMED)


def test_the_home_switch_is_bit_2_of_the_digital_inputs(switched: Callable[[float], Bench]) -> None:
    for start, expected in ((BELOW, 0), (ON, 4), (ABOVE, 0)):
        bench = switched(start)
        bench.boot()
        assert bench.read(0x60FD) == expected


def test_without_a_method_it_fails(bench: Bench) -> None:
    enable_in(bench, HOMING)
    bench.controlword(ENABLE | START)
    assert shown(bench) == BIT_13 | REACHED


def test_methods_that_the_drive_lacks_are_refused_and_60e3h_names_the_others(bench: Bench) -> None:
    bench.boot()
    taken = {method for method in range(-4, 38) if bench.write(0x6098, 0, method, 1) == "ok"}
    named = {bench.read(0x60E3, number, signed=True) for number in range(1, bench.read(0x60E3, 0) + 1)}
    assert taken == named | {0}


def test_a_reset_forgets_home() -> None:
    bench = Bench(position=0.3)
    home(bench, 37)
    bench.send(0x000, "81 05")
    bench.run(100)
    assert not has(bench, HOMED)
    assert position(bench) == pytest.approx(0.3 * COUNTS_PER_RADIAN, abs=20)
