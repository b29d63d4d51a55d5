"""Objects that the robot's file makes channels: by PDO where one brings them, else asked for."""

import math
import struct
import time
from collections.abc import Callable

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.channels import objection
from drivers.bus.device import CanDevice
from drivers.bus.settings import ChannelSettings, DeviceSettings
from drivers.samples import ComponentState, Sample
from eds import Description
from tests.support.waiting import until
from tests.unit.bus.conftest import IDENTITY, SMALL_EDS
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[..., Description]

TYPES = {  # index: data type
    0x2100: 0x0006,  # UNSIGNED16
    0x2101: 0x0003,  # INTEGER16
    0x2102: 0x0008,  # REAL32
    0x2103: 0x0001,  # BOOLEAN
    0x2104: 0x0009,  # VISIBLE_STRING
}
_SECTION = "[{0:04X}]\nParameterName=Object {0:04X}\nDataType={1}\nAccessType={2}\n"
EDS = (
    SMALL_EDS
    + "".join(_SECTION.format(index, code, "ro") for index, code in TYPES.items())
    + _SECTION.format(0x2105, 5, "wo")
)
PHASE = ChannelSettings(object="0x2100:0", scale=0.001, poll_hz=100)
LOAD = ChannelSettings(object="0x2101:0", unit="N", scale=0.5, offset=-1.0, poll_hz=100)
STRAIN = ChannelSettings(object="0x2102:0", unit="N·m", poll_hz=100)
SWING = ChannelSettings(object="0x2103:0", words={"0": "stance", "1": "swing"}, poll_hz=0)
OBJECTS = {
    **IDENTITY,
    (0x2100, 0): struct.pack("<H", 250),
    (0x2101, 0): struct.pack("<h", -4),
    (0x2102, 0): struct.pack("<f", 1.5),
}


def tpdo(*mapped: int, transmission_type: int = 1) -> dict[tuple[int, int], bytes]:
    entries = {(0x1A00, number): entry.to_bytes(4, "little") for number, entry in enumerate(mapped, 1)}
    return {
        (0x1800, 1): (0x185).to_bytes(4, "little"),
        (0x1800, 2): bytes([transmission_type]),
        (0x1A00, 0): bytes([len(mapped)]),
        **entries,
    }


def device(bus: CanBus, describe: Describe, **chosen: ChannelSettings) -> CanDevice:
    settings = DeviceSettings(bus="main", node_id=5, eds="small.eds", sdo_timeout_s=0.05, stale_after_s=0.1)
    return CanDevice("gait", settings, bus, describe(5, EDS), chosen)


def value(found: CanDevice, index: int) -> float | None:
    return found.latest.read(index, time.monotonic_ns())[0]


def problem(found: CanDevice) -> str:
    return found.quality(time.monotonic_ns()).problem or ""


def test_what_no_pdo_brings_is_asked_for_and_has_its_type_scale_and_offset(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    gait = device(bus, describe, phase=PHASE, load=LOAD, strain=STRAIN, swing=SWING)
    assert [(one.name, one.unit) for one in gait.channels] == [
        ("gait.phase", ""),
        ("gait.load", "N"),
        ("gait.strain", "N·m"),
        ("gait.swing", ""),
    ]
    assert gait.channels[3].enum == {0: "stance", 1: "swing"}
    with FakeNode(channel, 5, dict(OBJECTS)):
        gait.start()
        until(lambda: [value(gait, index) for index in range(3)] == [0.25, -3.0, 1.5])
        assert "swing: not asked for (poll_hz is 0), and no TPDO brings it" in problem(gait)
        gait.stop()
    assert value(gait, 0) is None


def test_what_a_pdo_brings_is_read_there_at_any_bit_and_not_asked_for(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    mapped = tpdo(0x2103_0001, 0x2102_0020, 0x2100_0010)
    with FakeNode(channel, 5, {**OBJECTS, **mapped}) as fake:
        gait = device(bus, describe, phase=PHASE, strain=STRAIN, swing=SWING)
        gait.start()
        until(lambda: gait.node.ready)
        strain = int.from_bytes(struct.pack("<f", -2.5), "little")
        frame = (1 | strain << 1 | 400 << 33).to_bytes(7, "little")

        def has_come() -> bool:
            fake.send(0x185, frame)
            return [value(gait, index) for index in range(3)] == [0.4, -2.5, 1.0]

        until(has_come)
        fake.send(0x185, frame[:5])
        until(lambda: gait.quality(time.monotonic_ns()).counters["short_frames"] == 1)
        assert not [data for can_id, data in fake.seen if can_id == 0x605 and data[1:3] == b"\x00\x21"]
        gait.stop()


def test_a_pdo_that_stays_away_and_an_object_that_is_refused_are_told(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    objects = {**OBJECTS, **tpdo(0x2100_0010)}
    with FakeNode(channel, 5, objects, aborts={(0x2101, 0): 0x0800_0022}):
        gait = device(bus, describe, phase=PHASE, load=LOAD)
        gait.start()
        until(lambda: "no phase: TPDO1 (0x185), which brings it on SYNC, does not come" in problem(gait))
        until(lambda: "load: " in problem(gait) and "0x2101:00" in problem(gait))
        until(lambda: gait.quality(time.monotonic_ns()).state is ComponentState.OK)  # the node itself answers
        gait.stop()


def test_a_mapping_that_cannot_be_leaves_the_device_and_its_channels_by_sdo(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, {**OBJECTS, **tpdo(0x2102_0040, 0x2100_0010)}):
        gait = device(bus, describe, phase=PHASE)
        gait.start()
        until(lambda: value(gait, 0) == 0.25)
        assert "its PDOs are not read: " in problem(gait)
        assert "maps 80 bits" in problem(gait)
        assert gait.node.ready
        gait.stop()


def test_what_came_before_a_reboot_is_not_shown_as_what_is_now(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait = device(bus, describe, phase=PHASE)
        gait.start()
        until(lambda: value(gait, 0) == 0.25)
        fake.silent = True
        fake.boot_up()
        until(lambda: not gait.node.ready)
        assert gait.latest.read(0, 0) == (None, None)
        gait.stop()


def test_one_object_that_is_never_answered_leaves_the_others_theirs(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), deaf_to={(0x2100, 0)}):
        gait = device(bus, describe, phase=PHASE, load=LOAD, strain=STRAIN)
        gait.start()
        until(lambda: (value(gait, 1), value(gait, 2)) == (-3.0, 1.5))
        assert value(gait, 0) is None
        gait.stop()


def test_an_answer_that_is_no_number_of_its_type_is_no_value(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    objects = {**OBJECTS, (0x2100, 0): b"31.5 degrees", (0x2102, 0): struct.pack("<f", math.nan)}
    with FakeNode(channel, 5, objects):
        gait = device(bus, describe, phase=PHASE, load=LOAD, strain=STRAIN)
        gait.start()
        until(lambda: "phase: the device answers with no number of its type" in problem(gait))
        assert "strain: the device answers with no number of its type" in problem(gait)
        assert value(gait, 0) is None
        until(lambda: value(gait, 1) == -3.0)
        gait.stop()


def test_an_answer_is_as_old_as_its_question_and_replaces_nothing_newer(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    gait = device(bus, describe, phase=PHASE, load=LOAD)
    asked: list[int] = []
    with FakeNode(channel, 5, {**OBJECTS, **tpdo(0x2100_0010, transmission_type=255)}) as fake:

        def changes_meanwhile(request: bytes) -> None:
            if request[1:3] == b"\x01\x21":
                asked.append(time.monotonic_ns())
            elif request[1:3] == b"\x00\x21":
                fake.send(0x185, struct.pack("<H", 400))

        fake.on_request = changes_meanwhile
        samples: list[Sample] = []
        gait.latest.subscribe(samples.append)
        gait.start()
        until(lambda: {index for one in samples for index in one.indices} == {0, 1})
        assert {one.values for one in samples if one.indices == (0,)} == {(0.4,)}
        assert next(one for one in samples if one.indices == (1,)).stamp_ns <= asked[0]
        gait.stop()


def test_what_comes_only_when_it_changes_and_is_not_asked_for_is_said(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, {**OBJECTS, **tpdo(0x2103_0001, transmission_type=255)}):
        gait = device(bus, describe, swing=SWING)
        gait.start()
        until(
            lambda: (
                "no swing: TPDO1 (0x185) brings it only when it changes, and poll_hz is 0" in problem(gait)
            )
        )
        gait.stop()


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("0x2999:0", "small.eds has no object 0x2999:0"),
        ("0x2100:1", "small.eds has no object 0x2100:1"),
        ("0x2104:0", "0x2104:0 is no number in small.eds"),
        ("0x2105:0", "0x2105:0 cannot be read, says small.eds"),
        ("0x2100:0", None),
    ],
)
def test_what_the_device_cannot_have_as_a_channel(describe: Describe, name: str, why: str | None) -> None:
    assert objection(ChannelSettings(object=name), describe(5, EDS)) == why


def test_a_channel_that_cannot_be_leaves_the_device_and_says_why(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)):
        gait = device(bus, describe, name=ChannelSettings(object="0x2104:0"), phase=PHASE)
        gait.start()
        until(lambda: value(gait, 1) == 0.25)
        assert value(gait, 0) is None
        assert "name: 0x2104:0 is no number in small.eds" in problem(gait)
        gait.stop()
