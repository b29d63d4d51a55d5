"""Where the position gets a TPDO: only where that is allowed and one is free; undone where it is refused."""

import math
import struct

import pytest

from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import drive_objects, tpdo
from tests.unit.joint.test_drive import STATUS_AND_POSITION, Make, quality, read


def test_nothing_is_remapped_unless_it_is_allowed(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x80000182)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        assert fake.writes == []
        knee.stop()


def test_where_it_is_allowed_a_free_tpdo_gets_the_position_and_it_is_told(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60610008) | tpdo(2, 0x80000282)
    with FakeNode(channel, 2, dict(objects)) as fake:
        fake.objects |= {(0x1A01, 1): bytes(4), (0x1A01, 2): bytes(4)}
        knee = joint(objects, configure_pdos=True, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        assert "TPDO2 (0x282) was given statusword and position, sent every 10 ms" in quality(knee)[1]
        assert {index for index, _, _ in fake.writes} == {0x1801, 0x1A01}  # the enabled one was left alone
        assert fake.writes[0] == (0x1801, 1, bytes.fromhex("82 02 00 C0"))  # disabled while it changes
        fake.send(0x282, struct.pack("<Hi", 0x0027, 250))
        until(lambda: read(knee, "position") is not None)
        assert read(knee, "position") == pytest.approx(math.pi / 2)
        knee.stop()


def test_an_enabled_tpdo_that_is_empty_is_free_where_no_disabled_one_is(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60610008) | tpdo(2, 0x282)
    with FakeNode(channel, 2, dict(objects)) as fake:
        fake.objects |= {(0x1A01, 1): bytes(4), (0x1A01, 2): bytes(4)}
        knee = joint(objects, configure_pdos=True)
        knee.start()
        until(lambda: knee.node.ready)
        assert "TPDO2 (0x282) was given statusword and position" in quality(knee)[1]
        assert {index for index, _, _ in fake.writes} == {0x1801, 0x1A01}
        knee.stop()


def test_an_empty_tpdo_that_refuses_a_mapping_is_enabled_and_empty_again(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(2, 0x282, transmission_type=254)
    with FakeNode(channel, 2, dict(objects), aborts={(0x1A01, 1): 0x06040041}) as fake:
        knee = joint(objects, configure_pdos=True, sdo_timeout_s=WAIT_S)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        assert "the object cannot be mapped to a PDO" in quality(knee)[1]
        assert fake.objects[0x1801, 1] == bytes.fromhex("82 02 00 00")
        assert (fake.objects[0x1801, 2], fake.objects[0x1A01, 0]) == (b"\xfe", b"\x00")
        knee.stop()


def test_a_multiplexed_pdo_is_not_empty_and_is_left_alone(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182) | {(0x1A00, 0): b"\xfe"}
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects, configure_pdos=True)
        knee.start()
        until(lambda: "no TPDO of the drive is free" in quality(knee)[1])
        assert "because TPDO1, multiplexed (MPDO), cannot be read here" in quality(knee)[1]
        assert fake.writes == []
        knee.stop()


def test_a_tpdo_without_an_identifier_brings_nothing(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0, *STATUS_AND_POSITION)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, poll_hz=0, slow_poll_hz=0)
        knee.start()
        until(lambda: knee.node.ready)
        assert "no TPDO is enabled" in quality(knee)[1]
        fake.send(0x000, struct.pack("<Hi", 0x1637, 250))  # as no NMT command is
        fake.heartbeat()
        until(lambda: knee.node.life.heartbeats)
        assert read(knee, "position") is None
        knee.stop()


def test_empty_tpdos_are_told_where_they_may_not_be_taken(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182) | tpdo(2, 0x282)
    with FakeNode(channel, 2, dict(objects)) as fake:
        knee = joint(objects)
        knee.start()
        until(lambda: "because TPDO1 and TPDO2 are enabled and empty" in quality(knee)[1])
        assert fake.writes == []
        knee.stop()


def test_a_drive_that_refuses_a_mapping_is_left_as_it_was_and_polled(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(2, 0x80000282)
    with FakeNode(channel, 2, dict(objects), aborts={(0x1A01, 1): 0x06040041}) as fake:
        knee = joint(objects, configure_pdos=True, sdo_timeout_s=WAIT_S)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        assert "the object cannot be mapped to a PDO" in quality(knee)[1]
        assert fake.objects == objects, "it is as it was"
        knee.stop()


def test_without_a_free_tpdo_nothing_is_changed(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(1, 0x182, 0x60610008)
    with FakeNode(channel, 2, objects) as fake:
        knee = joint(objects, configure_pdos=True)
        knee.start()
        until(lambda: "no TPDO of the drive is free" in quality(knee)[1])
        assert fake.writes == []
        knee.stop()


def test_where_two_drives_have_its_node_id_nothing_is_changed_and_it_is_read(
    joint: Make, channel: str
) -> None:
    objects = drive_objects() | tpdo(2, 0x80000282)
    with FakeNode(channel, 2, objects, repeat_replies=2) as fake:
        knee = joint(objects, configure_pdos=True)
        knee.start()
        until(lambda: read(knee, "position") is not None)
        assert "configure_pdos: two devices answer as node 2: nothing is written" in quality(knee)[1]
        assert fake.writes == []
        knee.stop()


MAPPABLE = {0x6077, 0x606C, 0x603F}
ROOM = {(0x1A01 + frame, number): bytes(4) for frame in (0, 1) for number in range(1, 5)}


def mapped(fake: FakeNode, number: int) -> list[str]:
    """Index and bits of what a TPDO brings."""
    entries = range(1, fake.objects[0x1A00 + number - 1, 0][0] + 1)
    raw = (int.from_bytes(fake.objects[0x1A00 + number - 1, entry], "little") for entry in entries)
    return [f"{one >> 16:04X} {one & 0xFF}" for one in raw]


def test_what_the_channels_need_is_mapped_whole(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(2, 0x80000282) | tpdo(3, 0x80000382)
    with FakeNode(channel, 2, dict(objects)) as fake:
        fake.objects |= ROOM
        knee = joint(objects, mappable=MAPPABLE, configure_pdos=True)
        knee.start()
        until(lambda: knee.node.ready)
        assert mapped(fake, 2) == ["6041 16", "6064 32", "6077 16"]
        assert mapped(fake, 3) == ["606C 32", "603F 16"]
        assert "was given statusword, position and torque, sent every 10 ms" in quality(knee)[1]
        assert "was given velocity and error_code, sent every 50 ms" in quality(knee)[1]
        fake.send(0x282, struct.pack("<Hih", 0x0027, 250, 100))
        fake.send(0x382, struct.pack("<iH", 500, 0))
        until(lambda: read(knee, "velocity") is not None)
        assert read(knee, "velocity") == pytest.approx(math.pi)
        knee.stop()


def test_what_does_not_fit_a_drive_is_left_out_and_that_tpdo_is_as_it_was(joint: Make, channel: str) -> None:
    objects = drive_objects() | tpdo(2, 0x80000282) | tpdo(3, 0xC0000385, 0x60770010, transmission_type=3)
    refused = {(0x1A01, 3): 0x06040042, (0x1A02, 2): 0x06040042}
    with FakeNode(channel, 2, dict(objects), aborts=dict(refused)) as fake:
        fake.objects |= {key: value for key, value in ROOM.items() if key not in objects}
        before = {key: fake.objects[key] for key in fake.objects if key[0] in (0x1802, 0x1A02)}
        knee = joint(objects, mappable=MAPPABLE, configure_pdos=True)
        knee.start()
        until(lambda: knee.node.ready)
        assert mapped(fake, 2) == ["6041 16", "6064 32"]
        kept = {key: before[key] for key in before if key[0] == 0x1802 or key[1] <= 1}
        assert {key: fake.objects[key] for key in kept} == kept
        assert "TPDO3 is as it was" in quality(knee)[1]
        knee.stop()
