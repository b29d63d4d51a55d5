"""Faults of a joint drive, as CiA 402 says that they look on the bus."""

import math
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from hil_sim.exoskeleton import Scenario
from tests.unit.hil_sim.outside import (
    ENABLED,
    IN_FAULT,
    KNEE,
    STATE_MASK,
    Outside,
    of,
    positions,
    statuswords,
)

EMCY = 0x080 + KNEE
COUNTS = 4096 * 100 / math.tau  # per rad at the joint
FOLLOWING_ERROR_BIT = 1 << 13


@pytest.fixture
def standing(tmp_path: Path) -> Iterator[Outside]:
    with closing(Outside(tmp_path, Scenario.STAND)) as outside:
        yield outside


def states(words: list[int]) -> list[int]:
    """The states in their order, each once."""
    found: list[int] = []
    for word in words:
        if found[-1:] != [word & STATE_MASK]:
            found.append(word & STATE_MASK)
    return found


def codes(outside: Outside, seconds: float) -> list[int]:
    return [int.from_bytes(data[:2], "little") for data in of(outside.run(seconds), EMCY)]


def test_overcurrent_is_an_emcy_and_the_state_fault(outside: Outside) -> None:
    outside.faults.begin("overcurrent", "left_knee")
    messages = outside.run(0.5)
    assert of(messages, EMCY) == [bytes.fromhex("1023 03 0000000000")]  # generic and current
    assert states(statuswords(messages, KNEE))[-1] == IN_FAULT
    assert outside.read(KNEE, 0x603F) == 0x2310
    assert outside.read(KNEE, 0x1001) == 0x03


def test_overtemperature_warms_up_before_it_trips(outside: Outside) -> None:
    before = outside.read(KNEE, 0x2010)
    outside.faults.begin("overtemperature", "left_knee", params={"to_c": 105, "rate_c_per_s": 100})
    assert codes(outside, 0.3) == []
    assert before + 200 < outside.read(KNEE, 0x2010) < 1000
    messages = outside.run(1.0)
    assert of(messages, EMCY) == [bytes.fromhex("1043 09 0000000000")]  # generic and temperature
    assert states(statuswords(messages, KNEE))[-1] == IN_FAULT
    assert outside.read(KNEE, 0x2010) == pytest.approx(1050, abs=10)


def test_undervoltage_is_an_emcy_and_fault_where_the_drive_is_enabled(outside: Outside) -> None:
    outside.faults.begin("undervoltage", "left_knee", for_s=0.5)
    messages = outside.run(0.4)
    assert of(messages, EMCY) == [bytes.fromhex("2032 05 0000000000")]  # generic and voltage
    assert states(statuswords(messages, KNEE))[-1] == IN_FAULT


def test_encoder_jump_is_seen_between_two_pdos_and_the_joint_pays_for_it(standing: Outside) -> None:
    joint = standing.robot.drives["left_knee"].joint
    before, where = positions(standing.run(0.5), KNEE)[-1], joint.position
    standing.faults.begin("encoder_jump", "left_knee", params={"degrees": 5})
    after = positions(standing.run(0.5), KNEE)
    assert after[0] - before == pytest.approx(math.radians(5) * COUNTS, rel=0.1)
    assert after[-1] == pytest.approx(before, abs=0.01 * COUNTS)
    assert joint.position == pytest.approx(where - math.radians(5), abs=0.01)


def test_encoder_stuck_shows_one_count_until_the_following_error(outside: Outside) -> None:
    assert outside.write(KNEE, 0x6066, 100, 2)[0] == 0x60  # ms beyond the window that are allowed
    outside.run(0.5)
    outside.faults.begin("encoder_stuck", "left_knee")
    messages = outside.run(2.5)
    assert len(set(positions(messages, KNEE)[1:])) == 1
    assert of(messages, EMCY)[0][:2] == bytes.fromhex("1186")
    assert states(statuswords(messages, KNEE))[-1] == IN_FAULT


def test_gear_slip_is_invisible_on_the_bus_and_true_at_the_joint(standing: Outside) -> None:
    joint = standing.robot.drives["left_knee"].joint
    standing.run(0.5)
    seen, true = standing.read(KNEE, 0x6064) / COUNTS, joint.position
    standing.faults.begin("gear_slip", "left_knee", params={"degrees": -4})
    standing.run(0.5)  # the drive goes back to where it is to be, and takes the joint with it
    assert standing.read(KNEE, 0x6064) / COUNTS == pytest.approx(seen, abs=0.01)
    assert joint.position == pytest.approx(true + math.radians(4), abs=0.01)


def test_following_error_sets_bit_13_before_the_emcy(outside: Outside) -> None:
    assert outside.write(KNEE, 0x6066, 100, 2)[0] == 0x60
    outside.faults.begin("following_error", "left_knee")
    messages = outside.run(3.0)
    words = statuswords(messages, KNEE)
    assert any(word & FOLLOWING_ERROR_BIT and word & STATE_MASK == ENABLED for word in words)
    assert states(words)[-1] == IN_FAULT
    assert [data[:2].hex() for data in of(messages, EMCY)] == ["1186"]


DISABLED, TORQUE_OFF = 0x40, 1 << 16


def inputs(outside: Outside) -> int:
    return outside.read(KNEE, 0x60FD)


def test_sto_takes_the_power_and_nothing_enables_the_drive_meanwhile(outside: Outside) -> None:
    assert inputs(outside) == 0
    outside.faults.begin("sto", "left_knee")
    messages = outside.run(0.3)
    assert of(messages, EMCY) == []
    assert states(statuswords(messages, KNEE))[-1] == DISABLED
    assert inputs(outside) == TORQUE_OFF
    for controlword in (0x06, 0x07, 0x0F):
        outside.write(KNEE, 0x6040, controlword, 2)
    assert outside.read(KNEE, 0x6041) & (STATE_MASK | 1 << 4) == DISABLED  # bit 4: no voltage at the motor
    outside.faults.clear("sto")
    assert inputs(outside) == 0
    assert outside.read(KNEE, 0x6041) & STATE_MASK == DISABLED, "it does not enable itself"


def test_sto_of_a_drive_in_fault_leaves_it_there(outside: Outside) -> None:
    outside.faults.begin("overcurrent", "left_knee")
    outside.run(0.3)
    outside.faults.begin("sto", "left_knee")
    assert outside.read(KNEE, 0x6041) & STATE_MASK == IN_FAULT


def test_limit_switch_is_its_bit_and_nothing_else(outside: Outside) -> None:
    outside.faults.begin("limit_switch", "left_knee")
    assert inputs(outside) == 0b10
    assert statuswords(outside.run(0.2), KNEE)[-1] & STATE_MASK == ENABLED
    outside.faults.clear()
    assert inputs(outside) == 0


def test_limit_switch_comes_at_once_by_the_pdo_that_carries_it(outside: Outside) -> None:
    assert outside.write(KNEE, 0x1803, 0x4000_0480 + KNEE, 4, subindex=1)[0] == 0x60
    outside.run(0.1)
    outside.faults.begin("limit_switch", "left_knee", params={"bit": 3})
    assert of(outside.run(0.05), 0x480 + KNEE)[0][4:] == (1 << 3).to_bytes(4, "little")


def test_drift_moves_a_joint_that_has_no_power_and_only_then(standing: Outside) -> None:
    standing.faults.begin("drift", "left_knee", params={"deg_per_s": 10})
    before = positions(standing.run(0.5), KNEE)[-1]
    assert positions(standing.run(0.5), KNEE)[-1] == pytest.approx(before, abs=0.01 * COUNTS)
    standing.faults.begin("sto", "left_knee")
    before = positions(standing.run(0.5), KNEE)[-1]
    moved = positions(standing.run(1.0), KNEE)[-1] - before
    assert moved == pytest.approx(math.radians(10) * COUNTS, rel=0.05)


def test_runaway_moves_the_joint_as_fast_as_it_says_and_back_when_it_is_over(standing: Outside) -> None:
    where = positions(standing.run(0.5), KNEE)[-1]
    standing.faults.begin("runaway", "left_knee", params={"deg_per_s": 60}, for_s=0.5)
    standing.run(0.1)
    at = positions(standing.run(0.3), KNEE)
    assert (at[-1] - at[0]) / 0.29 == pytest.approx(math.radians(60) * COUNTS, rel=0.1)
    assert positions(standing.run(1.5), KNEE)[-1] == pytest.approx(where, abs=0.01 * COUNTS)
