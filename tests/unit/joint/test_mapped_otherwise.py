"""A TPDO that is narrower than its object, of another type, or mapped otherwise by somebody meanwhile."""

import math
import struct
from collections.abc import Callable
from typing import Any

import can
import pytest

from drivers.bus import node
from drivers.joint.drive import JointDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.stop_rpdo import find_stop_rpdo
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, tpdo
from tests.unit.joint.test_drive import quality, read

Make = Callable[..., JointDrive]
POSITION, STATUSWORD, VELOCITY = 0x60640020, 0x60410010, 0x606C0020
REAL32 = 8


def test_a_part_of_a_number_is_not_taken_for_it(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, STATUSWORD, 0x60640010)
    objects[0x6064, 0] = (70_250).to_bytes(4, "little")
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        fake.send(0x182, struct.pack("<HH", 0x0250, 70_250 & 0xFFFF))
        until(lambda: knee.frames)
        assert read(knee, "position") == pytest.approx(70_250 / 1000 * math.tau)
        assert "TPDO1 maps 16 bits of position, which has 32 in its EDS" in quality(knee)[1]
        knee.stop()


def test_a_real_in_a_tpdo_is_one_and_what_is_no_number_is_none(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION, VELOCITY)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, types={0x606C: REAL32}, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<if", 250, 2.5))
        until(lambda: knee.frames)
        assert read(knee, "velocity") == pytest.approx(2.5 / 1000 * math.tau)
        fake.send(0x182, struct.pack("<if", 500, math.nan))
        until(lambda: knee.frames == 2)
        assert read(knee, "velocity") is None
        assert read(knee, "position") == pytest.approx(math.pi)
        knee.stop()


def test_another_masters_mapping_is_followed_without_a_boot(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION, VELOCITY)
    with FakeNode(channel, 2, dict(objects)) as fake, can.Bus(channel, interface="virtual") as master:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<ii", 250, 7))
        until(lambda: read(knee, "position") is not None)
        fake.objects |= tpdo(1, 0x182, VELOCITY, POSITION)  # frames are as long as before
        write = struct.pack("<BHBI", 0x23, 0x1A00, 2, POSITION)
        master.send(can.Message(arbitration_id=0x602, data=write, is_extended_id=False))
        until(lambda: not knee.node.ready)
        assert read(knee, "position") is None
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<ii", 7, 500))
        until(lambda: read(knee, "position") is not None)
        assert read(knee, "position") == pytest.approx(math.pi)
        knee.stop()


def test_frames_of_another_length_have_the_mapping_read_again(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION)
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        fake.send(0x182, struct.pack("<i", 250))
        until(lambda: knee.frames)
        fake.objects |= tpdo(1, 0x182, STATUSWORD, POSITION)
        for _ in range(3):
            fake.send(0x182, struct.pack("<Hi", 0x0250, 500))
        until(lambda: knee.short_frames == 3)
        until(lambda: knee.node.boots_begun > 1 and knee.node.ready)
        assert read(knee, "position") is None, "nothing was made of what came before"
        fake.send(0x182, struct.pack("<Hi", 0x0250, 500))
        until(lambda: read(knee, "position") is not None)
        assert read(knee, "position") == pytest.approx(math.pi)
        knee.stop()


def test_a_stray_frame_of_another_length_is_left_out_and_no_more(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION)
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        for data in (struct.pack("<i", 250), b"\x01", bytes(8), struct.pack("<i", 500)):
            fake.send(0x182, data)
        until(lambda: knee.frames == 2)
        assert knee.short_frames == 2
        assert read(knee, "position") == pytest.approx(math.pi)
        assert knee.node.boots_begun == 1
        knee.stop()


def test_what_is_mapped_otherwise_as_the_last_of_it_is_read_is_not_followed_as_it_was(
    joint: Make, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION, VELOCITY)
    monkeypatch.setattr(node, "REMAPPED_S", 600.0)
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        found, remapped = find_stop_rpdo, list[bool]()

        def just_then(*asked: Any) -> Any:
            rpdo = found(*asked)
            knee.node.remapped()
            remapped.append(True)
            return rpdo

        monkeypatch.setattr("drivers.joint.drive.find_stop_rpdo", just_then)
        knee.start()
        until(lambda: remapped and not knee.node.ready)
        knee.node.run(lambda _sdo: None).result(WAIT_S)  # what was under way has ended
        fake.send(0x182, struct.pack("<ii", 7, 500))
        fake.heartbeat()
        until(lambda: knee.node.life.heartbeats)
        assert (knee.frames, read(knee, "position")) == (0, None)
        knee.stop()


def test_a_stop_is_confirmed_while_a_mapping_changes_again_and_again(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, POSITION, VELOCITY)
    objects[0x6041, 0] = b"\x40\x02"
    with FakeNode(channel, 2, dict(objects)) as fake, can.Bus(channel, interface="virtual") as master:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        write = struct.pack("<BHBI", 0x23, 0x1A00, 2, POSITION)
        again = can.Message(arbitration_id=0x602, data=write, is_extended_id=False)
        storm = master.send_periodic(again, 0.05)
        until(lambda: not knee.node.ready)
        assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
        fake.send(0x182, struct.pack("<ii", 250, 7))
        assert read(knee, "position") is None
        assert "mapped otherwise" in str(quality(knee)[1])
        storm.stop()
        until(lambda: knee.node.ready)
        knee.stop()
