"""What cannot be believed of a joint, or is reported by it, is in its quality: in words, and never green."""

import struct
import time
from collections.abc import Callable

import pytest

from drivers.joint.drive import JointDrive
from drivers.joint.leg_pairs import join_joints
from drivers.samples import ComponentState, Quality
from tests.support.waiting import until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, surroundings, tpdo
from tests.unit.joint.test_drive import STATUS_AND_POSITION

Make = Callable[..., JointDrive]

ENABLED, IN_FAULT, OFF = 0x0027, 0x0008, 0x0040
MAPPED = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION) | tpdo(2, 0x282, 0x606C0020)


def quality(joint: JointDrive) -> Quality:
    return joint.quality(time.monotonic_ns())


def send(fake: FakeNode, counts: int, counts_per_s: int = 0, statusword: int = ENABLED) -> None:
    fake.send(0x282, struct.pack("<i", counts_per_s))
    fake.send(0x182, struct.pack("<Hi", statusword, counts))


def test_a_frozen_encoder_is_a_fault_until_it_counts_again(joint: Make, channel: str) -> None:
    with FakeNode(channel, 2, MAPPED) as fake:
        knee = joint(MAPPED, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        until(lambda: quality(knee).state is ComponentState.OK, step=lambda: send(fake, 250, 100))
        until(lambda: quality(knee).findings, step=lambda: send(fake, 250, 100))
        found = quality(knee)
        assert found.state is ComponentState.FAULT
        assert "its position stays the same to the count while it turns at" in str(found.problem)
        assert "check its encoder" in found.findings[0].check
        until(lambda: quality(knee).state is ComponentState.OK, step=lambda: send(fake, 251, 100))
        assert quality(knee).findings == ()
        knee.stop()


def test_what_explains_something_is_told_before_it(joint: Make, channel: str) -> None:
    objects = MAPPED | {(0x6091, 1): (50).to_bytes(4, "little"), (0x6091, 2): (1).to_bytes(4, "little")}
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        until(lambda: quality(knee).findings, step=lambda: send(fake, 250, 100))
        said = str(quality(knee).problem)
        assert said.startswith(
            "gear_ratio is 1, but the drive's 6091h says 50: angles may be wrong; its position"
        )
        knee.stop()


def test_a_drive_that_an_input_holds_off_stands_and_is_no_fault(joint: Make, channel: str) -> None:
    objects = MAPPED | surroundings()  # with the interlock set
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=50)
        knee.start()
        until(lambda: knee.node.ready)
        until(
            lambda: str(quality(knee).problem).startswith(
                "the drive is off: interlock (60FDh bit 3) holds it"
            ),
            step=lambda: send(fake, 250, statusword=OFF),
        )
        assert quality(knee).state is ComponentState.OK
        knee.stop()


def test_a_drive_that_reports_an_error_and_goes_on_is_told_in_words(joint: Make, channel: str) -> None:
    with FakeNode(channel, 2, MAPPED) as fake:
        knee = joint(MAPPED, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.emcy(0x2351, 0x02)
        until(lambda: knee.node.life.active_emcy)
        until(lambda: quality(knee).state is ComponentState.OK, step=lambda: send(fake, 250))
        assert "it reports 0x2351 load level warning (I²t, thermal state) (register: current) (" in str(
            quality(knee).problem
        )
        until(
            lambda: quality(knee).state is ComponentState.FAULT,
            step=lambda: send(fake, 250, statusword=IN_FAULT),
        )
        assert str(quality(knee).problem).count("0x2351") == 1, "once, as what the fault is"
        fake.emcy(0)
        until(lambda: knee.node.life.active_emcy is None)
        until(lambda: quality(knee).state is ComponentState.OK, step=lambda: send(fake, 250))
        assert quality(knee).problem is None
        knee.stop()


def test_a_drive_that_stops_answering_is_told_beside_its_values(joint: Make, channel: str) -> None:
    with FakeNode(channel, 2, MAPPED) as fake:
        knee = joint(MAPPED, slow_poll_hz=50)
        knee.start()
        until(lambda: knee.node.ready)
        fake.silent = True
        until(lambda: "answers no SDO" in str(quality(knee).problem), step=lambda: send(fake, 250))
        assert quality(knee).state is ComponentState.OK, "its position comes"
        fake.silent = False
        until(lambda: quality(knee).problem is None, step=lambda: send(fake, 250))
        knee.stop()


@pytest.mark.parametrize(
    ("names", "judged"),
    [
        (("left_knee", "right_knee"), True),
        (("left_knee", "right_hip"), False),
        (("knee", "right_knee"), False),
    ],
)
def test_joints_of_one_name_are_judged_against_each_other(
    joint: Make, names: tuple[str, str], judged: bool
) -> None:
    made = {name: joint(drive_objects(), name=name, axis=0) for name in names}
    join_joints(made)
    assert all((one._watch.check.mirror is not None) is judged for one in made.values())
