"""Faults of an SDO server, as its client sees them (CiA 301 §7.2.4)."""

from tests.unit.hil_sim.outside import GAIT, KNEE, Outside, of

READ_PROFILE_VELOCITY = bytes.fromhex("4081600000000000")
READ_NAME = bytes.fromhex("4008100000000000")


def test_sdo_duplicate_answers_every_request_twice_with_the_same_bytes(shared: Outside) -> None:
    shared.faults.begin("sdo_duplicate", "left_knee")
    first, second = shared.ask(KNEE, READ_PROFILE_VELOCITY)
    assert first == second
    assert first[:4] == bytes.fromhex("43816000")
    assert len(shared.ask(KNEE, READ_NAME)) == 2
    shared.faults.clear()
    assert len(shared.ask(KNEE, READ_PROFILE_VELOCITY)) == 1


def test_sdo_late_brings_the_answer_to_the_last_request_after_the_next_one(shared: Outside) -> None:
    shared.faults.begin("sdo_late", "left_knee", params={"delay_ms": 300})
    assert shared.ask(KNEE, READ_PROFILE_VELOCITY, 0.2) == []
    (answer,) = shared.ask(KNEE, bytes.fromhex("4041600000000000"), 0.2)
    assert answer[:4] == bytes.fromhex("43816000")  # about 6081h, not 6041h
    (answer,) = of(shared.run(0.2), 0x580 + KNEE)
    assert answer[1:4] == bytes.fromhex("416000")


def test_sdo_late_leaves_the_node_as_quick_as_before_in_everything_else(shared: Outside) -> None:
    shared.faults.begin("sdo_late", "left_knee")
    messages = shared.run(0.3)
    assert of(messages, 0x700 + KNEE)
    assert of(messages, 0x180 + KNEE)
    assert shared.read(1, 0x6041)


def test_a_node_that_answers_late_falls_silent_too(shared: Outside) -> None:
    shared.faults.begin("sdo_late", "left_knee", params={"delay_ms": 300})
    shared.faults.begin("sdo_silent", "left_knee")
    assert shared.ask(KNEE, READ_PROFILE_VELOCITY, 0.5) == []


def test_two_answers_that_are_late_are_two(shared: Outside) -> None:
    for name in ("sdo_late", "sdo_duplicate"):
        shared.faults.begin(name, "left_knee")
    assert len(shared.ask(KNEE, READ_PROFILE_VELOCITY, 1.0)) == 2
    shared.faults.clear()
    for name in ("sdo_duplicate", "sdo_late"):
        shared.faults.begin(name, "left_knee")
    assert len(shared.ask(KNEE, READ_PROFILE_VELOCITY, 1.0)) == 2


def test_sdo_silent_answers_nothing_and_takes_the_write_all_the_same(shared: Outside) -> None:
    before = shared.read(KNEE, 0x6081)
    shared.faults.begin("sdo_silent", "left_knee")
    assert shared.ask(KNEE, b"\x23\x81\x60\x00" + (before + 1).to_bytes(4, "little"), 0.5) == []
    assert of(shared.run(0.3), 0x700 + KNEE)
    shared.faults.clear()
    assert shared.read(KNEE, 0x6081) == before + 1


def test_sdo_abort_refuses_the_nth_write_alone_and_does_not_carry_it_out(shared: Outside) -> None:
    shared.faults.begin("sdo_abort", "gait", params={"nth": 2, "code": 0x0800_0022})
    assert shared.write(GAIT, 0x2001, 410, 2)[0] == 0x60
    assert shared.write(GAIT, 0x2002, 1500, 2).hex(" ") == "80 02 20 00 22 00 00 08"
    assert shared.write(GAIT, 0x2003, 70, 2)[0] == 0x60
    assert shared.read(GAIT, 0x2001) == 410
    assert shared.read(GAIT, 0x2002) != 1500
    assert shared.read(GAIT, 0x2003) == 70


def test_sdo_abort_counts_a_segmented_write_once(shared: Outside) -> None:
    shared.faults.begin("sdo_abort", "left_knee", params={"nth": 1})
    (answer,) = shared.ask(KNEE, bytes.fromhex("2181600004000000"))
    assert answer.hex(" ") == "80 81 60 00 20 00 00 08"
    assert shared.ask(KNEE, bytes.fromhex("2181600004000000"))[0][0] == 0x60
    assert shared.ask(KNEE, bytes.fromhex("0700800000000000"))[0][0] == 0x20
    assert shared.read(KNEE, 0x6081) == 0x8000
