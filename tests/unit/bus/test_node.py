"""A node's life: late boot, boot-up again, heartbeat, EMCY, and the words for where it is stuck."""

import contextlib
import time
from collections.abc import Callable

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.liveness import EMCY_HISTORY
from drivers.bus.node import shared_node
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import CanSettings, DeviceSettings
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError, SettingsError, Unavailable
from drivers.samples import ComponentState
from eds import Description
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[[int], Description]


def device(bus: CanBus, describe: Describe, **more: object) -> CanDevice:
    times = {"sdo_timeout_s": 0.2, **more}
    settings = DeviceSettings(bus="main", node_id=5, eds="small.eds", **times)  # type: ignore[arg-type]
    return CanDevice("gait", settings, bus, describe(5))


def problem(found: CanDevice) -> str:
    return found.quality(time.monotonic_ns()).problem or ""


def state(found: CanDevice) -> ComponentState:
    return found.quality(time.monotonic_ns()).state


def test_a_node_that_answers_is_ready_and_sends_nothing_but_answers(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        assert state(gait) is ComponentState.OK
        gait.stop()
        assert {can_id for can_id, _ in fake.seen} == {0x605}
        assert fake.writes == []


def test_reading_and_writing_an_object(bus: CanBus, channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, {**IDENTITY, (0x2001, 0): bytes.fromhex("90 01 FF FF")}) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        assert gait.node.upload(0x2001, 0).result(WAIT_S) == b"\x90\x01"  # no more than an UNSIGNED16 has
        gait.node.download(0x2001, 0, b"\xa4\x01").result(WAIT_S)
        gait.node.run(lambda sdo: sdo.download(0x2001, 0, b"\xa5\x01"), urgent=True).result(WAIT_S)
        assert fake.writes == [(0x2001, 0, b"\xa4\x01"), (0x2001, 0, b"\xa5\x01")]
        gait.stop()
        with pytest.raises(Unavailable, match=r"gait.*not open|not open"):
            gait.node.upload(0x2001, 0).result(WAIT_S)


def test_several_objects_are_read_in_a_row_and_what_cannot_be_read_is_an_error_in_its_place(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, {**IDENTITY, (0x2001, 0): b"\x90\x01"}):
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        step, absent, vendor = gait.node.upload_all([(0x2001, 0), (0x2009, 0), (0x1018, 1)]).result(WAIT_S)
        assert (step, vendor) == (b"\x90\x01", IDENTITY[0x1018, 1])
        assert isinstance(absent, DeviceAbort)
        gait.stop()


def test_after_an_object_that_is_not_answered_no_other_is_asked_for(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    objects = {**IDENTITY, (0x2001, 0): b"\x90\x01"}
    with FakeNode(channel, 5, objects, deaf_to={(0x2009, 0)}) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        found = gait.node.upload_all([(0x2001, 0), (0x2009, 0), (0x2001, 0), (0x2001, 0)]).result(WAIT_S)
        assert found[0] == b"\x90\x01"
        assert isinstance(found[1], DeviceTimeout)
        assert len(found) == 2
        assert sum(data[1:3] == b"\x01\x20" for _can_id, data in fake.seen) == 1
        gait.stop()


def test_when_a_node_answered_last_counts_refusals_and_no_silence(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    objects = {**IDENTITY, (0x2001, 0): b"\x90\x01"}
    with FakeNode(channel, 5, objects, deaf_to={(0x2009, 0)}):
        gait = device(bus, describe)
        assert gait.node.answered_ns == 0
        gait.start()
        until(lambda: gait.node.ready)
        for index, answers in ((0x2001, True), (0x2009, False), (0x2008, True)):
            asked_ns = time.monotonic_ns()
            with contextlib.suppress(DriverError):
                gait.node.upload(index, 0).result(WAIT_S)
            assert (gait.node.answered_ns > asked_ns) is answers
        gait.stop()


def test_what_was_read_before_an_urgent_job_is_not_read_again(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    """Else those that come again and again would keep all that waits behind for ever."""
    with FakeNode(channel, 5, {**IDENTITY, (0x2001, 0): b"\x90\x01"}) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        asked = 0

        def interrupt_every_second(request: bytes) -> None:
            nonlocal asked
            if request[:3] == b"\x40\x01\x20":
                asked += 1
                if asked % 2 == 0:
                    gait.node.run(lambda sdo: sdo.upload(0x1000, 0), urgent=True)

        fake.on_request = interrupt_every_second
        found = gait.node.upload_all([(0x2001, 0)] * 8).result(WAIT_S)
        assert found == [b"\x90\x01"] * 8
        gait.stop()


def test_replies_that_come_twice_confuse_no_reading(bus: CanBus, channel: str, describe: Describe) -> None:
    objects = {**IDENTITY, (0x2001, 0): b"\x90\x01", (0x2002, 0): bytes(range(100))}
    with FakeNode(channel, 5, objects, repeat_replies=2):
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        for _ in range(20):
            assert gait.node.upload(0x2001, 0).result(WAIT_S) == b"\x90\x01"
            assert gait.node.upload(0x1018, 1).result(WAIT_S) == b"\x34\x12\0\0"
            assert gait.node.upload(0x2002, 0).result(WAIT_S) == bytes(range(100))
        gait.stop()


def test_a_node_that_boots_late_is_picked_up(bus: CanBus, channel: str, describe: Describe) -> None:
    gait = device(bus, describe)
    gait.start()
    until(lambda: "no frame at all on bus main" in problem(gait))
    assert state(gait) is ComponentState.LOST
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        fake.boot_up()
        until(lambda: gait.node.ready)
        assert gait.node.life.boots == 1
        gait.stop()


def test_others_on_the_bus_are_told_apart_from_a_dead_bus(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 9) as other:
        gait = device(bus, describe)
        gait.start()
        until(lambda: bus.opened)
        other.heartbeat()
        until(lambda: "no frame at all from node 5, others are heard" in problem(gait))
        gait.stop()


@pytest.mark.parametrize(
    ("send", "words"),
    [
        (
            lambda fake: fake.heartbeat(0x7F),
            r"its heartbeat comes (pre-operational), but it answers no SDO on 0x605",
        ),
        (
            lambda fake: fake.heartbeat(0x04),
            "it is stopped (NMT) and answers no SDO until its master starts it",
        ),
        (lambda fake: fake.send(0x185, bytes(8)), "PDOs of node 5 come, but it answers no SDO on 0x605"),
    ],
)
def test_a_node_that_answers_no_sdo_is_told_by_what_it_does_send(
    bus: CanBus, channel: str, describe: Describe, send: Callable[[FakeNode], None], words: str
) -> None:
    with FakeNode(channel, 5, silent=True) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: bus.opened)

        def told() -> bool:
            send(fake)
            return words in problem(gait)

        until(told)
        gait.stop()


def test_a_user_that_cannot_boot_says_why_and_is_tried_again(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    class Picky:
        attempts = 0

        def boot(self, sdo: SdoChannel) -> None:
            self.attempts += 1
            if self.attempts < 3:
                raise DriverError("the mapping is unreadable")

        def forget(self) -> None:
            """Nothing was kept."""

    with FakeNode(channel, 5, dict(IDENTITY)):
        gait, picky = device(bus, describe), Picky()
        gait.node.attach(picky, "picky")
        until(lambda: gait.node.problem(time.monotonic_ns()) == "the mapping is unreadable")
        until(lambda: gait.node.ready)
        assert picky.attempts == 3
        gait.node.detach(picky)


def test_a_boot_up_message_starts_everything_anew_also_when_it_comes_twice(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        asked = len(fake.requests)
        fake.boot_up()
        fake.boot_up()
        until(lambda: gait.node.life.boots == 2 and gait.node.ready)
        assert len(fake.requests) > asked
        gait.stop()


def test_a_heartbeat_that_stays_away_is_told_while_sdo_works(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, {**IDENTITY, (0x1017, 0): (20).to_bytes(2, "little")}) as fake:
        gait = device(bus, describe, stale_after_s=0.05, lost_after_s=0.2)
        gait.start()
        until(lambda: gait.node.ready)
        fake.heartbeat()
        until(lambda: gait.node.life.heartbeats)
        until(lambda: state(gait) is ComponentState.LOST)
        until(lambda: "its heartbeat has been missing for" in problem(gait))
        assert gait.node.upload(0x1000, 0).result(WAIT_S)

        def is_back() -> bool:
            fake.heartbeat()
            return state(gait) is ComponentState.OK

        until(is_back)
        gait.stop()


def test_a_node_of_another_make_than_its_eds_is_told(bus: CanBus, channel: str, describe: Describe) -> None:
    with FakeNode(channel, 5, {**IDENTITY, (0x1018, 2): b"\x43\0\0\0"}):
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        assert problem(gait).startswith(
            "1018h product code is 0x43, the EDS small.eds is for 0x42: nothing is"
        )
        gait.stop()


def test_an_emcy_storm_is_bounded_counted_and_told_in_words(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        for _ in range(500):
            fake.emcy(0x8110, 0x11)
        until(lambda: gait.node.life.emcys == 500)
        assert len(gait.node.life.emcy_history) == EMCY_HISTORY
        assert state(gait) is ComponentState.FAULT
        assert "0x8110 CAN overrun: messages were lost (register: generic, communication)" in problem(gait)
        fake.emcy(0)
        until(lambda: state(gait) is ComponentState.OK)
        gait.stop()


def test_emcys_are_followed_to_the_identifier_the_device_uses(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5, {**IDENTITY, (0x1014, 0): (0xA5).to_bytes(4, "little")}) as fake:
        gait = device(bus, describe)
        gait.start()
        until(lambda: gait.node.ready)
        fake.send(0xA5, bytes.fromhex("11 86 01 00 00 00 00 00"))
        until(lambda: gait.node.life.active_emcy)
        gait.stop()


def test_another_sdo_channel_is_used_where_it_is_configured(
    bus: CanBus, channel: str, describe: Describe
) -> None:
    with FakeNode(channel, 5) as fake:
        gait = device(bus, describe, sdo_cob_ids=(0x641, 0x5C1))
        gait.start()
        until(lambda: 0x641 in {can_id for can_id, _ in fake.seen})
        assert 0x605 not in {can_id for can_id, _ in fake.seen}
        gait.stop()


def test_one_node_id_has_one_worker_whoever_uses_it(bus: CanBus, describe: Describe, channel: str) -> None:
    with FakeNode(channel, 5, dict(IDENTITY)):
        first, second = device(bus, describe), device(bus, describe)
        assert first.node is second.node
        first.start()
        second.start()
        until(lambda: first.node.ready)
        first.stop()
        assert second.node.upload(0x1000, 0).result(WAIT_S)
        second.stop()


def test_a_node_described_by_two_files_is_refused(bus: CanBus, describe: Describe, tmp_path: object) -> None:
    first = device(bus, describe)
    other = describe(5)
    moved = other.path.rename(other.path.with_name("other.eds"))
    object.__setattr__(other, "path", moved)
    with pytest.raises(
        SettingsError, match=r"node 5 on bus main is described by small\.eds and by other\.eds"
    ):
        shared_node(bus, 5, other, first.settings)


@pytest.mark.parametrize(("interface", "asks"), [("socketcand", True), ("virtual", False)])
def test_a_time_out_on_a_simulated_bus_is_not_blamed_on_the_device_alone(
    interface: str, asks: bool, describe: Describe
) -> None:
    table = {"interface": interface, "channel": "sim", "host": "127.0.0.1", "port": 1}
    node = device(CanBus("main", CanSettings.from_table(table)), describe).node
    assert ("does the simulator keep real time" in node.channel.also_silent) is asks
