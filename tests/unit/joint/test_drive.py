"""A joint shows what its drive sends, however the drive is mapped, and says what is wrong with it."""

import math
import struct
import time
from collections.abc import Callable

import pytest

import eds
from drivers.bus.settings import ChannelSettings
from drivers.errors import Unavailable
from drivers.joint.cia402 import DriveState
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.samples import ComponentState, Sample
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, surroundings, tpdo

Make = Callable[..., JointDrive]

STATUS_AND_POSITION = (0x60410010, 0x60640020)


def read(joint: JointDrive, quantity: str) -> float | None:
    index = next(at for at, channel in enumerate(joint.channels) if channel.quantity == quantity)
    return joint.latest.read(index, time.monotonic_ns())[0]


def quality(joint: JointDrive) -> tuple[ComponentState, str]:
    found = joint.quality(time.monotonic_ns())
    return found.state, found.problem or ""


def test_a_mapped_drive_shows_its_angle_state_and_words_for_them(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x40000182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, direction=-1, zero_offset=0.5)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x1637, 250))
        until(lambda: knee.frames)
        assert read(knee, "position") == pytest.approx(0.5 - math.pi / 2)
        assert read(knee, "statusword") == 0x1637
        assert read(knee, "state") == DriveState.OPERATION_ENABLED
        assert quality(knee) == (ComponentState.OK, "")
        units = {channel.name: channel.unit for channel in knee.channels}
        assert units["left_knee.position"] == "rad"
        assert knee.channels[-1].enum == {int(state): state.words for state in DriveState}
        knee.stop()
        assert read(knee, "position") is None


@pytest.mark.parametrize(
    ("number", "cob_id", "mapped", "frame"),
    [
        (3, 0x382, (0x60640020,), "FA 00 00 00"),  # on TPDO3, alone
        (2, 0x282, (0x60640020, 0x606C0020), "FA 00 00 00 07 00 00 00"),
        (1, 0x1F3, (0x60610008, 0x60640020, 0x60410010), "08 FA 00 00 00 37 06"),  # COB-ID of its own
        (7, 0x182, (0x00050008, 0x60640020), "FF FA 00 00 00"),  # after a dummy entry
        (1, 0x20012345, (0x60640020,), "FA 00 00 00"),  # a 29-bit identifier
    ],
)
def test_the_mapping_is_the_devices_own(
    joint: Make, channel: str, number: int, cob_id: int, mapped: tuple[int, ...], frame: str
) -> None:
    objects = drive_objects() | tpdo(1, 0x80000182) | tpdo(number, cob_id, *mapped)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        extended = bool(cob_id & 0x20000000)
        fake.send_message(cob_id & 0x1FFFFFFF, bytes.fromhex(frame), extended=extended)
        until(lambda: knee.frames)
        assert read(knee, "position") == pytest.approx(math.pi / 2)
        knee.stop()


def test_what_changes_in_the_device_is_read_again_after_it_boots(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60640020)
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.objects |= tpdo(1, 0x1A2, 0x60410010, 0x60640020)
        fake.boot_up()
        until(lambda: knee.node.life.boots and knee.node.ready)
        fake.send(0x182, struct.pack("<i", 999))
        fake.send(0x1A2, struct.pack("<Hi", 0x0027, 500))
        until(lambda: knee.frames)
        assert read(knee, "position") == pytest.approx(math.pi)
        assert knee.frames == 1
        knee.stop()


def test_a_drive_without_position_in_its_tpdos_is_polled_and_says_so(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60410010)
    objects[0x6064, 0] = (250).to_bytes(4, "little")
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, poll_hz=100)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        assert read(knee, "position") == pytest.approx(math.pi / 2)
        until(lambda: read(knee, "error_code") is not None)
        state, words = quality(knee)
        assert state is ComponentState.OK
        assert words == "position: asked by SDO at 100 Hz, because none of its 1 enabled TPDOs carries it"
        assert fake.writes == []
        knee.stop()


def test_polled_values_are_of_their_type_and_one_without_an_answer_costs_no_other(
    joint: Make, channel: str
) -> None:
    described = drive_objects()
    objects = dict(described)
    objects[0x6064, 0] = (250).to_bytes(4, "little")
    objects[0x6077, 0] = (-10).to_bytes(2, "little", signed=True) + bytes(2)  # four bytes, of which two count
    objects[0x603F, 0] = b"no error, thank you"
    with FakeNode(channel, 2, objects, deaf_to={(0x606C, 0)}):
        knee = joint(described, poll_hz=50, slow_poll_hz=50)
        knee.start()
        until(lambda: read(knee, "torque") is not None)
        assert (read(knee, "torque") or 0.0) < 0.0
        assert read(knee, "error_code") is None
        until(lambda: read(knee, "position") == pytest.approx(math.pi / 2))
        knee.stop()


def test_a_drive_without_any_tpdo_is_polled_for_position_and_state(joint: Make, channel: str) -> None:
    objects = drive_objects()
    with FakeNode(channel, 2, objects):
        knee = joint(objects, poll_hz=50)
        knee.start()
        until(lambda: read(knee, "state") == DriveState.SWITCH_ON_DISABLED)
        until(lambda: read(knee, "position") == 0)
        assert (
            "position and statusword: asked by SDO at 50 Hz, because no TPDO is enabled" in quality(knee)[1]
        )
        knee.stop()


def test_what_a_tpdo_brings_only_when_it_changes_is_kept_fresh_by_sdo(joint: Make, channel: str) -> None:
    objects = drive_objects()
    objects |= tpdo(1, 0x182, 0x60410010, transmission_type=255) | tpdo(2, 0x282, 0x60640020)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=50)
        knee.start()
        until(lambda: read(knee, "state") == DriveState.SWITCH_ON_DISABLED)
        assert (0x6064, 0) not in {(int.from_bytes(r[1:3], "little"), r[3]) for r in fake.requests}
        knee.stop()


def test_a_tpdo_with_an_event_timer_needs_no_help(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION, transmission_type=255)
    objects[0x1800, 5] = (10).to_bytes(2, "little")
    with FakeNode(channel, 2, objects):
        knee = joint(objects)
        knee.start()
        until(lambda: knee.node.ready)
        assert knee.reading is not None
        assert knee.reading.tpdos[0].trigger == "every 0.01 s"
        until(lambda: read(knee, "error_code") is not None)
        assert read(knee, "statusword") is None
        knee.stop()


def test_digital_inputs_and_supply_voltage_are_told_where_the_drive_has_them(
    joint: Make, channel: str
) -> None:
    objects = drive_objects(axes=2) | surroundings() | surroundings(axis=1)
    objects[0x68FD, 0] = bytes(4)
    with FakeNode(channel, 2, objects):
        knee, ankle = (
            joint(objects, slow_poll_hz=50),
            joint(objects, name="left_ankle", axis=1, slow_poll_hz=50),
        )
        knee.start()
        ankle.start()
        until(lambda: read(knee, "voltage") is not None and read(ankle, "voltage") is not None)
        assert read(knee, "voltage") == pytest.approx(48.0)
        assert (read(knee, "digital_inputs"), read(ankle, "digital_inputs")) == (0x8001_0008, 0)
        units = {one.quantity: one.unit for one in knee.channels}
        assert (units["voltage"], units["digital_inputs"]) == ("V", "")
        ankle.stop()
        knee.stop()
    before = [one.quantity for one in joint(drive_objects()).channels]
    assert [one.quantity for one in knee.channels] == [*before[:-1], "digital_inputs", "voltage", "state"]


def test_digital_inputs_are_taken_from_a_tpdo_that_brings_them(joint: Make, channel: str) -> None:
    objects = drive_objects() | surroundings() | tpdo(1, 0x182, 0x60FD0020, 0x60790020)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<II", 0xFFFF_FFFF, 24_500))
        until(lambda: knee.frames)
        assert read(knee, "digital_inputs") == 0xFFFF_FFFF
        assert read(knee, "voltage") == pytest.approx(24.5)
        knee.stop()


def test_what_only_its_maker_has_is_a_channel_beside_its_own_or_in_their_place(
    joint: Make, channel: str
) -> None:
    objects = drive_objects() | surroundings() | tpdo(1, 0x182, 0x60410010, 0x60790020)
    chosen = {
        "voltage": ChannelSettings(object="0x6079:0", unit="V", scale=0.01),
        "brake": ChannelSettings(object="0x60FD:0", words={"0": "closed"}, poll_hz=50),
    }
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, chosen=chosen, poll_hz=50)
        assert [one.quantity for one in knee.channels][-3:] == ["state", "voltage", "brake"]
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<HI", 0x1637, 4_800))
        until(lambda: read(knee, "voltage") == 48.0 and read(knee, "brake") == 0x8001_0008)
        assert read(knee, "state") == DriveState.OPERATION_ENABLED
        knee.stop()


def test_what_the_device_does_not_have_hides_nothing_that_it_has(joint: Make, channel: str) -> None:
    objects = drive_objects() | surroundings()
    with FakeNode(channel, 2, objects, aborts={(0x60FD, 0): 0x0602_0000}):
        knee = joint(objects, slow_poll_hz=50)
        knee.start()
        until(lambda: read(knee, "voltage") is not None)
        assert read(knee, "digital_inputs") is None
        knee.stop()


def test_polling_can_be_forbidden(joint: Make, channel: str) -> None:
    objects = drive_objects()
    with FakeNode(channel, 2, objects):
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        assert read(knee, "position") is None
        assert "not asked for (poll_hz is 0)" in quality(knee)[1]
        knee.stop()


def test_two_axes_of_one_drive_are_two_joints_on_one_node(joint: Make, channel: str) -> None:
    objects = drive_objects(axes=2)
    objects |= tpdo(1, 0x182, 0x60410010, 0x60640020) | tpdo(2, 0x282, 0x68410010, 0x68640020)
    objects[0x685A, 0] = (6).to_bytes(2, "little")
    with FakeNode(channel, 2, objects) as fake:
        knee, ankle = joint(objects), joint(objects, name="left_ankle", axis=1)
        knee.start()
        ankle.start()
        until(lambda: knee.node.ready and knee.reading and ankle.reading)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        fake.send(0x282, struct.pack("<Hi", 0x0007, -250))
        until(lambda: knee.frames and ankle.frames)
        assert read(knee, "position") == pytest.approx(math.pi / 2)
        assert read(ankle, "position") == pytest.approx(-math.pi / 2)
        assert ankle.reading is not None
        assert ankle.reading.options["quick_stop"] == 6
        fake.objects[0x6841, 0] = b"\x07\x00"
        assert ankle.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
        assert {index for index, _, _ in fake.writes} == {0x6840}
        ankle.stop()
        fake.send(0x182, struct.pack("<Hi", 0x0027, 500))
        until(lambda: knee.frames >= 2)
        knee.stop()


def test_an_axis_that_the_eds_does_not_have_is_refused(joint: Make) -> None:
    with pytest.raises(eds.EdsError, match=r"0x6841 .*0x6864 .*missing, which axis 1 needs"):
        joint(drive_objects(), axis=1)


def test_what_the_drive_does_on_quick_stop_and_lost_master_is_read(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects):
        knee = joint(objects)
        knee.start()
        until(lambda: knee.node.ready)
        assert knee.reading is not None
        assert knee.reading.options == {"quick_stop": 2, "abort_connection": 1}
        assert knee.reading.tpdos[0].trigger == "on SYNC"
        knee.stop()


def test_silence_becomes_stale_then_lost_and_names_the_tpdo(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION, transmission_type=1)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, stale_after_s=0.1, lost_after_s=0.5)
        knee.start()
        until(lambda: knee.node.ready)
        assert quality(knee)[0] is ComponentState.LOST
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: read(knee, "position") is not None)
        until(lambda: quality(knee)[0] is ComponentState.STALE)
        assert read(knee, "position") is None
        until(lambda: quality(knee)[0] is ComponentState.LOST)
        assert "TPDO1 (0x182), which brings it on SYNC, does not come" in quality(knee)[1]
        knee.stop()


def test_a_drive_in_fault_is_told_with_its_emcy(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0218, 250))
        until(lambda: quality(knee)[0] is ComponentState.FAULT)
        assert "does not say why" in quality(knee)[1]
        fake.emcy(0x8611, 0x01)
        until(lambda: knee.node.life.active_emcy)
        fake.send(0x182, struct.pack("<Hi", 0x0218, 250))
        until(
            lambda: (
                quality(knee)
                == (
                    ComponentState.FAULT,
                    "the drive is in fault: 0x8611 following error too large (register: generic)",
                )
            )
        )
        knee.stop()


def test_a_fault_before_we_came_is_told_by_the_drives_error_code(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION, 0x603F0010)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<HiH", 0x0218, 250, 0x3220))
        until(lambda: quality(knee)[0] is ComponentState.FAULT)
        assert quality(knee)[1] == "the drive is in fault: 0x3220 DC link undervoltage"
        knee.stop()


def test_a_frame_shorter_than_its_mapping_is_counted_and_not_guessed(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, b"\x27\x00\xfa\x00\x00")
        until(lambda: knee.short_frames)
        assert read(knee, "position") is None
        knee.stop()


def test_a_mapping_that_cannot_be_is_named(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60640020, 0x606C0020, 0x60410010)
    with FakeNode(channel, 2, objects):
        knee = joint(objects)
        knee.start()
        until(lambda: "0x1A00 maps 80 bits, more than a frame holds" in quality(knee)[1])
        knee.stop()


def test_a_mapping_that_is_not_answered_names_the_object(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects, deaf_to={(0x1A00, 1)}):
        knee = joint(objects, sdo_timeout_s=0.05)
        knee.start()
        until(lambda: "reading 0x1A00:01: no answer within 0.05 s" in quality(knee)[1])
        assert quality(knee)[0] is ComponentState.LOST
        knee.stop()


def test_a_contradiction_of_scaling_is_told_beside_good_values(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, rated_torque=50)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 250))
        until(lambda: quality(knee)[0] is ComponentState.OK)
        assert "rated_torque is 50 N·m, but the drive's 6076h times gear_ratio makes 0.4" in quality(knee)[1]
        knee.stop()


def test_listeners_get_what_came_together_with_its_time(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, slow_poll_hz=0)
        samples: list[Sample] = []
        knee.latest.subscribe(samples.append)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<Hi", 0x0027, 500))
        until(lambda: samples)
        names = [knee.channels[index].quantity for index in samples[0].indices]
        assert dict(zip(names, samples[0].values, strict=True)) == {
            "statusword": 0x0027,
            "position": pytest.approx(math.pi),
            "state": DriveState.OPERATION_ENABLED,
        }
        knee.stop()


def test_a_stop_of_a_joint_that_is_not_started_says_so(joint: Make) -> None:
    with pytest.raises(Unavailable, match="not open"):
        joint(drive_objects()).quick_stop().result(WAIT_S)


def test_a_stop_goes_ahead_of_a_long_reading(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects, deaf_to={(0x1A00, 1)}) as fake:
        knee = joint(objects, sdo_timeout_s=10.0)
        knee.start()
        until(lambda: any(request[1:4] == b"\x00\x1a\x01" for request in fake.requests))
        assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
        fake.deaf_to.clear()
        until(lambda: knee.node.ready)
        knee.stop()


def test_starting_and_stopping_again_and_again_leaves_nothing(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects)
        for _ in range(5):
            knee.start()
            knee.start()
            until(lambda: knee.node.ready)
            knee.stop()
            knee.stop()
        assert quality(knee)[0] is ComponentState.LOST
        assert fake.writes == []
