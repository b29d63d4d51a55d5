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
        assert fake.objects[0x1801, 1] == bytes.fromhex("82 02 00 40")
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
        assert fake.objects[0x1801, 1] == bytes.fromhex("82 02 00 C0")
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
