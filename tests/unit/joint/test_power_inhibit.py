"""A drive that an input holds off is told so; one that is merely off is not."""

import pytest

import eds
from drivers.joint.cia402 import DriveState
from drivers.joint.power_inhibit import PowerInhibit

OFF, ON = DriveState.SWITCH_ON_DISABLED, DriveState.OPERATION_ENABLED
SECOND_NS = 1_000_000_000
HOME, INTERLOCK, STO, OTHER = 1 << 2, 1 << 3, 1 << 16, 1 << 20


def drive(file: str) -> PowerInhibit:
    return PowerInhibit(eds.load(eds.locate(file, None), 2))


@pytest.mark.parametrize(
    ("inputs", "names"), [(STO, "STO (60FDh bit 16)"), (INTERLOCK, "interlock (60FDh bit 3)")]
)
def test_an_input_that_is_known_says_why_the_joint_stands(inputs: int, names: str) -> None:
    known = drive("joint_drive.eds")
    known.update(0, OFF, inputs | HOME)
    assert known.words == f"the drive is off: {names} holds it; nothing enables it until that is released"
    known.update(0, ON, inputs)
    assert known.words is None
    known.update(0, OFF, inputs)
    known.restart()
    assert known.words is None


@pytest.mark.parametrize("inputs", [0, HOME, None])
def test_a_drive_that_is_merely_off_is_not_held(inputs: int | None) -> None:
    known = drive("joint_drive.eds")
    known.update(0, OFF, inputs)
    assert known.words is None


def test_of_a_drive_that_nobody_knows_the_input_is_told_that_came_as_it_went_off() -> None:
    unknown = drive("trinamic_tmcm_1270.eds")
    unknown.update(0, OFF, OTHER | STO)
    assert unknown.words is None, "it was never seen enabled: any input may be set"
    for second in range(3):
        unknown.update(second * SECOND_NS, ON, OTHER)
    unknown.update(4 * SECOND_NS, ON, OTHER | STO)  # asked before the state was
    unknown.update(4 * SECOND_NS, OFF, OTHER | STO | HOME)
    assert unknown.words == "the drive went off as bit 16 of its inputs (60FDh) was set: is that its STO?"
    unknown.update(5 * SECOND_NS, OFF, OTHER)
    assert unknown.words is None, "switched off by somebody"
