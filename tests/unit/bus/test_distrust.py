"""Nothing is written to a node that may not be the right one, or the only one; it is read and stopped."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.sdo.channel import OUT_OF_SYNC
from drivers.bus.sdo.duplicate_answers import CLEAN, RECENT
from drivers.bus.settings import DeviceSettings
from drivers.errors import DeviceTimeout, NotPermitted
from eds import Description
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[[int], Description]

STEP = (0x2001, 0)
OBJECTS = {**IDENTITY, STEP: b"\x90\x01"}
TWO = "two devices answer as node 5: nothing is written to it; give one of them another node id"


@pytest.fixture
def gait(bus: CanBus, describe: Describe) -> Iterator[CanDevice]:
    """Patient: a busy computer answers late. It is stopped whatever happens."""
    with stopped(of(bus, describe(5), 2.0)) as device:
        yield device


@pytest.fixture
def hasty(bus: CanBus, describe: Describe) -> Iterator[CanDevice]:
    """Where most answers never come."""
    with stopped(of(bus, describe(5), 0.1)) as device:
        yield device


@contextmanager
def stopped(device: CanDevice) -> Iterator[CanDevice]:
    try:
        yield device
    finally:
        device.stop()


def of(bus: CanBus, description: Description, timeout_s: float) -> CanDevice:
    settings = DeviceSettings(bus="main", node_id=5, eds="small.eds", sdo_timeout_s=timeout_s)
    return CanDevice("gait", settings, bus, description)


def refusal(gait: CanDevice) -> str:
    """Why a write is not sent; it is checked that reading goes on."""
    with pytest.raises(NotPermitted) as caught:
        gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
    assert gait.node.upload(*STEP).result(WAIT_S) == b"\x90\x01"
    return str(caught.value)


def until_distrusted(gait: CanDevice) -> None:
    until(lambda: gait.node.ready)
    until(lambda: gait.node.upload(*STEP).result(WAIT_S) and gait.node.ready and gait.node.distrust)


def stop_it(gait: CanDevice) -> None:
    gait.node.run(lambda sdo: sdo.download(0x6040, 0, b"\x02\x00"), urgent=True).result(WAIT_S)


def problem(gait: CanDevice) -> str:
    return gait.quality(time.monotonic_ns()).problem or ""


@pytest.mark.parametrize(
    ("subindex", "name", "should"), [(1, "vendor id", "0x1234"), (2, "product code", "0x42")]
)
@pytest.mark.parametrize(("held", "is_"), [(b"\x43\0\0\0", "is 0x43"), (None, "cannot be read")])
def test_a_device_of_another_make_is_read_and_stopped_but_not_written(
    gait: CanDevice, channel: str, subindex: int, name: str, should: str, held: bytes | None, is_: str
) -> None:
    objects = dict(OBJECTS)
    del objects[0x1018, subindex]
    objects |= {} if held is None else {(0x1018, subindex): held}
    with FakeNode(channel, 5, objects) as fake:
        gait.start()
        until(lambda: gait.node.ready)
        why = f"1018h {name} {is_}, the EDS small.eds is for {should}: nothing is written to it; correct its"
        assert why in refusal(gait)
        assert why in problem(gait)
        assert fake.writes == []
        stop_it(gait)
        assert fake.writes == [(0x6040, 0, b"\x02\x00")]
        gait.stop()


def test_a_device_whose_eds_names_none_is_written(
    bus: CanBus, channel: str, describe: Callable[..., Description]
) -> None:
    text = "[DeviceInfo]\nVendorNumber=0\n[2001]\nParameterName=Step\nDataType=6\nAccessType=rw\n"
    settings = DeviceSettings(bus="main", node_id=5, eds="small.eds", sdo_timeout_s=0.1)
    gait = CanDevice("gait", settings, bus, describe(5, text))
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.start()
        until(lambda: gait.node.ready)
        gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        gait.stop()
        assert fake.writes == [(*STEP, b"\xa4\x01")]


def test_nothing_is_written_before_it_was_asked_what_it_is(gait: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), silent=True) as fake:
        gait.start()
        until(lambda: fake.requests)
        with pytest.raises(NotPermitted, match="not come up"):
            gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        fake.silent = False
        until(lambda: gait.node.ready)
        gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        gait.stop()
        assert fake.writes == [(*STEP, b"\xa4\x01")]


def test_nothing_is_written_to_one_that_has_booted_and_not_said_yet_what_it_is(
    gait: CanDevice, channel: str
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.start()
        until(lambda: gait.node.ready)
        fake.silent, begun = True, gait.node.boots_begun
        fake.boot_up()
        until(lambda: gait.node.boots_begun > begun)
        with pytest.raises(NotPermitted, match="not come up"):
            gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        gait.stop()
        assert fake.writes == []


def test_after_a_boot_it_is_asked_again_what_it_is(gait: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.start()
        until(lambda: gait.node.ready)
        fake.objects[0x1018, 2], begun = b"\x43\0\0\0", gait.node.boots_begun
        fake.boot_up()
        until(lambda: gait.node.boots_begun > begun)
        refusal(gait)
        until(lambda: gait.node.ready)
        assert "0x43" in refusal(gait)
        gait.stop()
        assert fake.writes == []


@pytest.mark.parametrize("delay_s", [0.0, 0.005])
def test_where_two_devices_have_its_node_id_neither_is_written(
    gait: CanDevice, channel: str, delay_s: float
) -> None:
    """The second may be slower, so that its answers come during the next request."""
    with (
        FakeNode(channel, 5, dict(OBJECTS)) as one,
        FakeNode(channel, 5, dict(OBJECTS), delay_s=delay_s) as other,
    ):
        gait.start()
        until_distrusted(gait)
        assert TWO in refusal(gait)
        assert TWO in problem(gait)
        assert gait.node.counters()["sdo_doubled"] >= 2
        assert one.writes == other.writes == []
        stop_it(gait)
        until(lambda: one.writes == other.writes == [(0x6040, 0, b"\x02\x00")])
        gait.stop()


def test_once_there_is_but_one_again_it_is_written_again(gait: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), repeat_replies=2) as fake:
        gait.start()
        until_distrusted(gait)
        fake.repeat_replies = 1
        for _ in range(CLEAN + RECENT + 1):
            gait.node.upload(*STEP).result(WAIT_S)
        gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        gait.stop()
        assert fake.writes == [(*STEP, b"\xa4\x01")]


def test_a_device_that_boots_is_not_held_to_be_two_any_more(gait: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), repeat_replies=2) as fake:
        gait.start()
        until_distrusted(gait)
        fake.repeat_replies, begun = 1, gait.node.boots_begun
        fake.boot_up()
        until(lambda: gait.node.boots_begun > begun and gait.node.ready)
        gait.node.download(*STEP, b"\xa4\x01").result(WAIT_S)
        gait.stop()
        assert fake.writes == [(*STEP, b"\xa4\x01")]


def test_an_answer_that_comes_twice_now_and_then_changes_nothing(gait: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.start()
        until(lambda: gait.node.ready)

        def repeat_some(request: bytes) -> None:
            fake.repeat_replies = 2 if request[:3] == b"\x40\x01\x20" else 1

        fake.on_request = repeat_some
        for _ in range(10):
            gait.node.upload(*STEP).result(WAIT_S)
            gait.node.download(*STEP, b"\x90\x01").result(WAIT_S)
        gait.node.upload(0x1000, 0).result(WAIT_S)
        assert gait.node.counters()["sdo_doubled"] == 10
        gait.stop()


def test_a_device_whose_answers_cannot_be_assigned_is_not_written(hasty: CanDevice, channel: str) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        hasty.start()
        until(lambda: hasty.node.ready)
        fake.silent = True
        fake.on_request = lambda request: fake.send(
            0x585, b"\x43\x41\x60\0" + bytes(4)
        )  # what nobody asked for
        for _ in range(OUT_OF_SYNC):
            with pytest.raises(DeviceTimeout):
                hasty.node.upload(*STEP).result(WAIT_S)
        with pytest.raises(NotPermitted, match="to which request node 5 answers: nothing is written"):
            hasty.node.download(0x2002, 0, b"\xa4\x01").result(WAIT_S)
        assert "to which request node 5 answers" in problem(hasty)
        fake.silent = False
        hasty.node.channel.timeout_s = WAIT_S
        assert hasty.node.upload(*STEP).result(WAIT_S) == b"\x90\x01"
        hasty.node.download(0x2002, 0, b"\xa4\x01").result(WAIT_S)
        hasty.stop()
        assert [write[0] for write in fake.writes] == [0x2002]


def test_a_node_that_answers_once_again_is_trusted_though_nobody_asks_it(
    gait: CanDevice, channel: str
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.start()
        until(lambda: gait.node.ready)
        fake.repeat_replies = 2
        for _ in range(4):
            gait.node.upload(*STEP).result(WAIT_S)
        until(lambda: gait.node.distrust == TWO)
        fake.repeat_replies = 1
        until(lambda: gait.node.distrust is None)
        gait.stop()
