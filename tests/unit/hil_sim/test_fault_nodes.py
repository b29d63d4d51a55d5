"""Faults of one CANopen device, as CiA 301 says that they look on the bus."""

import pytest

from hil_sim.faults.fault import FaultRefused
from tests.unit.hil_sim.outside import GAIT, KNEE, Outside, errors, of

HEARTBEAT = 0x700 + KNEE
OWN = (0x080 + KNEE, 0x180 + KNEE, 0x280 + KNEE, 0x580 + KNEE, HEARTBEAT)
BOOT_UP, OPERATIONAL, STOPPED, PRE_OPERATIONAL = b"\x00", b"\x05", b"\x04", b"\x7f"
READ_STATUSWORD = bytes.fromhex("4041600000000000")


def silent(outside: Outside, seconds: float = 0.5) -> bool:
    messages = outside.run(seconds)
    assert of(messages, 0x180 + 1), "the others go on"
    return not any(of(messages, cob_id) for cob_id in OWN)


def test_node_lost_is_silent_on_every_identifier_and_boots_when_it_is_over(outside: Outside) -> None:
    outside.faults.begin("node_lost", "left_knee", for_s=1.0)
    assert silent(outside)
    assert outside.ask(KNEE, READ_STATUSWORD) == []
    messages = outside.run(1.0)
    assert of(messages, HEARTBEAT)[0] == BOOT_UP
    assert of(messages, 0x000) == [bytes([1, KNEE])]  # its master starts it


def test_reboot_shows_one_boot_up_and_forgets_what_was_not_stored(outside: Outside) -> None:
    before = outside.read(KNEE, 0x6081)
    assert outside.write(KNEE, 0x6081, before + 1, 4)[0] == 0x60
    outside.faults.begin("reboot", "left_knee")
    assert of(outside.run(0.5), HEARTBEAT).count(BOOT_UP) == 1
    assert outside.read(KNEE, 0x6081) == before


def test_reboot_of_a_node_without_power_is_refused_in_words(outside: Outside) -> None:
    outside.faults.begin("node_lost", "left_knee")
    with pytest.raises(FaultRefused, match="left_knee is switched off by another fault"):
        outside.faults.begin("reboot", "left_knee")
    assert silent(outside)


def test_late_boot_comes_when_it_was_said(outside: Outside) -> None:
    outside.faults.begin("late_boot", "left_knee", params={"boot_s": 0.8})
    assert silent(outside, 0.75)
    assert of(outside.run(0.1), HEARTBEAT) == [BOOT_UP]


def test_node_stopped_says_so_and_answers_no_sdo_until_it_is_started(outside: Outside) -> None:
    outside.faults.begin("node_stopped", "left_knee")
    messages = outside.run(0.5)
    assert of(messages, 0x000) == [bytes([2, KNEE])]
    assert set(of(messages, HEARTBEAT)) == {STOPPED}
    assert of(outside.run(0.3), 0x180 + KNEE) == []
    assert outside.ask(KNEE, READ_STATUSWORD) == []
    outside.faults.clear()
    messages = outside.run(0.5)
    assert of(messages, 0x000) == [bytes([1, KNEE])]
    assert set(of(messages, HEARTBEAT)[1:]) == {OPERATIONAL}  # the first one may be on its way already
    assert of(messages, 0x180 + KNEE)


def test_emcy_has_the_code_and_the_error_register_and_is_taken_back(outside: Outside) -> None:
    outside.faults.begin("emcy", "left_knee", params={"code": 0x4210})
    assert of(outside.run(0.1), 0x080 + KNEE) == [bytes.fromhex("1042 09 0000000000")]  # generic, temperature
    assert outside.read(KNEE, 0x1001) == 0x09
    outside.faults.clear()
    assert of(outside.run(0.1), 0x080 + KNEE) == [bytes(8)]
    assert outside.read(KNEE, 0x1001) == 0
    assert outside.read(KNEE, 0x1003, 1) == 0x4210


def test_heartbeat_missing_leaves_sdo_and_pdos_alone(outside: Outside) -> None:
    assert of(outside.run(0.3), HEARTBEAT)
    outside.faults.begin("heartbeat_missing", "left_knee", for_s=1.0)
    messages = outside.run(0.5)
    assert of(messages, HEARTBEAT) == []
    assert len(of(messages, 0x180 + KNEE)) > 20
    assert outside.read(KNEE, 0x6041)
    assert set(of(outside.run(1.0), HEARTBEAT)) == {OPERATIONAL}


def test_tpdo_silent_leaves_heartbeat_and_sdo_alone(outside: Outside) -> None:
    assert of(outside.run(0.3), 0x180 + KNEE)
    outside.faults.begin("tpdo_silent", "left_knee")
    messages = outside.run(0.5)
    assert not any(of(messages, base + KNEE) for base in (0x180, 0x280, 0x380, 0x480))
    assert set(of(messages, HEARTBEAT)) == {OPERATIONAL}
    assert outside.read(KNEE, 0x6041)
    outside.faults.clear()
    assert of(outside.run(0.2), 0x180 + KNEE)


def test_bus_off_comes_after_32_errors_and_ends_without_a_boot_up(outside: Outside) -> None:
    outside.faults.begin("bus_off", "left_knee", for_s=1.0)
    messages = outside.run(0.5)
    assert errors(messages) == 32  # 8 each, up to 256 (ISO 11898-1)
    assert not any(of(messages, cob_id) for cob_id in OWN)
    assert outside.ask(KNEE, READ_STATUSWORD) == []
    messages = outside.run(1.0)
    assert of(messages, 0x080 + KNEE)[0][:2] == bytes.fromhex("4081")  # recovered from bus off
    assert set(of(messages, HEARTBEAT)) == {PRE_OPERATIONAL}  # 1029h:1 = 0
    assert errors(messages) == 0
    assert outside.read(KNEE, 0x6041) & 0x6F != 0x27  # 6007h = 3: quick stop


def test_bus_off_of_a_node_that_is_to_stay_operational_brings_it_back_so(outside: Outside) -> None:
    assert outside.write(KNEE, 0x1029, 1, 1, subindex=1)[0] == 0x60
    outside.faults.begin("bus_off", "left_knee", for_s=0.5)
    outside.run(0.5)
    assert set(of(outside.run(0.5), HEARTBEAT)) == {OPERATIONAL}


def test_the_controller_itself_can_be_lost(outside: Outside) -> None:
    outside.faults.begin("node_lost", "gait", for_s=0.5)
    assert of(outside.run(0.4), 0x080) == []  # nobody sends SYNC
    assert of(outside.run(0.5), 0x700 + GAIT)[0] == BOOT_UP
    assert of(outside.run(0.2), 0x080)
