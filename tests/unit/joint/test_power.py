"""A joint's drive is stopped by the channel that its bus allows, and a stop overtakes every way up."""

import struct
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

import eds
from drivers.bus.bus import CanBus
from drivers.bus.node import Node
from drivers.bus.sdo.worker import SdoWorker
from drivers.bus.settings import CanSettings, Role
from drivers.joint import quick_stop
from drivers.joint.cia402 import DriveState
from drivers.joint.drive import JointDrive
from drivers.joint.power import PowerDrive
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.settings import JointSettings
from drivers.joint.stop_rpdo import StopRpdo
from drivers.joint.transitions import OVERTAKEN, Led
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.joint.conftest import Objects, drive_eds, drive_objects
from tests.unit.joint.sdo_drive import SdoDrive
from tests.unit.joint.standard import S, after, statusword

OUR_SYNC = {"sync_period_s": 0.01}
TARGET = (4321).to_bytes(4, "little")
COMMAND_MODE_TARGET = (0x60400010, 0x60600008, 0x607A0020)


def rpdo(transmission_type: int, *mapped: int, cob_id: int = 0x202) -> Objects:
    """RPDO1, mapped so; with the objects that it carries."""
    objects: Objects = {
        (0x1400, 1): cob_id.to_bytes(4, "little"),
        (0x1400, 2): bytes([transmission_type]),
        (0x1600, 0): bytes([len(mapped)]),
        (0x6060, 0): b"\x08",
        (0x607A, 0): TARGET,
    }
    return objects | {(0x1600, at): entry.to_bytes(4, "little") for at, entry in enumerate(mapped, 1)}


@pytest.fixture
def make(channel: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., JointDrive]:
    """Patient: a drive that answers late is not asked twice."""
    monkeypatch.setattr(quick_stop, "FIRST_PATIENCE_S", WAIT_S)

    def joint(objects: Objects, role: Role, **more: float) -> JointDrive:
        path = tmp_path / "drive.eds"
        path.write_text(drive_eds(objects))
        bus = CanBus("main", CanSettings(interface="virtual", channel=channel, **more), role)  # type: ignore[arg-type]
        settings = JointSettings(
            bus="main",
            node_id=2,
            eds="",
            counts_per_revolution=1000,
            gear_ratio=1,
            sdo_timeout_s=WAIT_S,
            stop_timeout_s=WAIT_S,
        )
        return JointDrive("left_knee", settings, bus, eds.load(path, 2))

    return joint


class Drive(FakeNode):
    """A fake node with the standard's state machine behind SDO and RPDO1."""

    def __init__(self, channel: str, objects: Objects, state: DriveState = S.OPERATION_ENABLED) -> None:
        super().__init__(channel, 2, dict(objects), on_write=self._written)
        self.go(state)

    def __enter__(self) -> "Drive":
        super().__enter__()
        return self

    def go(self, state: DriveState) -> None:
        self.state = state
        self.objects[0x6041, 0] = statusword(state).to_bytes(2, "little")

    def rpdos(self) -> list[bytes]:
        return [data for can_id, data in self.seen if can_id == 0x202]

    def controlwords(self) -> list[int]:
        return [int.from_bytes(data, "little") for index, _, data in self.writes if index == 0x6040]

    def _written(self, index: int, _subindex: int, data: bytes) -> None:
        if index == 0x6040:
            self.go(after(self.state, int.from_bytes(data, "little"), 0x80, stays=True))


def started(joint: JointDrive) -> JointDrive:
    joint.start()
    until(lambda: joint.node.ready)
    return joint


class TestChannel:
    @pytest.mark.parametrize("transmission_type", [1, 254, 255])
    def test_an_observer_never_sends_an_rpdo(
        self, make: Callable[..., JointDrive], channel: str, transmission_type: int
    ) -> None:
        objects = drive_objects() | rpdo(transmission_type, *COMMAND_MODE_TARGET)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.OBSERVER, sync_period_s=0.01))
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert drive.rpdos() == []
            assert drive.controlwords() == [0x0002]
            assert {can_id for can_id, _ in drive.seen} == {0x602}

    @pytest.mark.parametrize(
        ("transmission_type", "sync", "expected"),
        [
            (255, {}, True),
            (254, {}, True),
            (1, {"sync_period_s": 0.01}, True),
            (1, {}, False),
            (253, {}, False),
        ],
    )
    def test_a_master_sends_an_rpdo_that_takes_effect_without_anybody_else(
        self,
        make: Callable[..., JointDrive],
        channel: str,
        transmission_type: int,
        sync: dict[str, float],
        expected: bool,
    ) -> None:
        objects = drive_objects() | rpdo(transmission_type, *COMMAND_MODE_TARGET)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER, **sync))
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert bool(drive.rpdos()) is expected
            assert drive.controlwords() == [0x0002]  # by SDO too: this drive is deaf to RPDOs

    def test_its_other_objects_are_as_last_sent(self, make: Callable[..., JointDrive], channel: str) -> None:
        objects = drive_objects() | rpdo(255, *COMMAND_MODE_TARGET)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER))
            knee.quick_stop().result(WAIT_S)
            knee.node.download(0x607A, 0, (77).to_bytes(4, "little")).result(WAIT_S)
            knee.quick_stop().result(WAIT_S)
            knee.stop()
            assert drive.rpdos() == [struct.pack("<Hbi", 2, 8, 4321), struct.pack("<Hbi", 2, 8, 77)]

    def test_what_it_would_carry_beside_must_be_known(
        self, make: Callable[..., JointDrive], channel: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        objects = drive_objects() | rpdo(255, *COMMAND_MODE_TARGET)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER))
            monkeypatch.setattr(StopRpdo, "_held", lambda self, one: None if one == (0x607A, 0) else b"\x08")
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert drive.rpdos() == []

    def test_after_a_reboot_nothing_is_sent_by_the_mapping_of_before(
        self, make: Callable[..., JointDrive], channel: str
    ) -> None:
        objects = drive_objects() | rpdo(255, *COMMAND_MODE_TARGET)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER))
            drive.deaf_to.add((0x1000, 0))  # so that it does not come up again
            drive.boot_up()
            drive.heartbeat()  # operational already
            until(lambda: knee.node.life.heartbeats and not knee.node.ready)
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert drive.rpdos() == []

    @pytest.mark.parametrize("cob_id", [0x8000_0202])
    def test_an_rpdo_that_is_not_valid_is_none(
        self, make: Callable[..., JointDrive], channel: str, cob_id: int
    ) -> None:
        objects = drive_objects() | rpdo(255, *COMMAND_MODE_TARGET, cob_id=cob_id)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER))
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert drive.rpdos() == []

    def test_an_rpdo_whose_other_objects_nobody_knows_is_none(
        self, make: Callable[..., JointDrive], channel: str
    ) -> None:
        objects = drive_objects() | rpdo(255, 0x60400010, 0x23000120)
        with Drive(channel, objects) as drive:
            knee = started(make(objects, Role.MASTER))
            assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
            knee.stop()
            assert drive.rpdos() == []


def test_the_controlword_is_on_the_bus_before_the_call_returns(
    make: Callable[..., JointDrive], channel: str
) -> None:
    """By the caller's own thread, past a transfer that is never answered."""
    objects = drive_objects()
    with Drive(channel, objects) as drive:
        knee = started(make(objects, Role.OBSERVER))
        drive.deaf_to.add((0x2001, 0))
        drive.objects[0x2001, 0] = b"\x01"
        knee.node.upload(0x2001, 0)
        until(lambda: _asked(drive, 0x2001), "a transfer hangs")
        stopped = knee.quick_stop(wake=False)
        until(lambda: drive.controlwords() == [0x0002], "sent, though nobody was woken")
        knee.wake()
        assert stopped.result(WAIT_S) is StopOutcome.CONFIRMED
        knee.stop()
        assert drive.controlwords() == [0x0002]  # once: whoever waits has found it sent


def _asked(drive: FakeNode, index: int) -> bool:
    return any(
        request[0] == 0x40 and request[1:3] == index.to_bytes(2, "little") for request in drive.requests
    )


def test_disable_voltage_is_confirmed_by_a_drive_without_current(
    make: Callable[..., JointDrive], channel: str
) -> None:
    objects = drive_objects()
    with Drive(channel, objects) as drive:
        knee = started(make(objects, Role.OBSERVER))
        assert knee.disable_voltage().result(WAIT_S) is StopOutcome.CONFIRMED
        knee.stop()
        assert drive.state is S.SWITCH_ON_DISABLED
        assert drive.controlwords() == [0x0000]


def test_nmt_stop_is_for_the_node_alone(make: Callable[..., JointDrive], channel: str) -> None:
    objects = drive_objects()
    with Drive(channel, objects) as drive:
        knee = started(make(objects, Role.OBSERVER))
        knee.nmt_stop()
        until(lambda: (0x000, b"\x02\x02") in drive.seen)
        knee.stop()


def test_a_way_up_that_waits_for_its_turn_is_not_begun_after_a_stop(
    make: Callable[..., JointDrive], channel: str
) -> None:
    objects = drive_objects()
    with Drive(channel, objects, S.SWITCH_ON_DISABLED) as drive:
        knee = started(make(objects, Role.MASTER))
        drive.deaf_to.add((0x2001, 0))
        knee.node.channel.timeout_s = 1.0
        knee.node.upload(0x2001, 0)  # keeps the worker
        step = knee.step_up(S.SWITCH_ON_DISABLED)
        assert knee.quick_stop().result(WAIT_S) is StopOutcome.CONFIRMED
        drive.deaf_to.clear()
        assert step.result(WAIT_S).problem == OVERTAKEN
        knee.stop()
        assert drive.controlwords() == [0x0002]


@pytest.fixture
def axes(channel: str, tmp_path: Path) -> Iterator[tuple[FakeNode, list[JointDrive]]]:
    """Two axes of one drive, both enabled."""
    objects = drive_objects(axes=2)
    path = tmp_path / "drive.eds"
    path.write_text(drive_eds(objects))
    bus = CanBus("main", CanSettings(interface="virtual", channel=channel))
    table = {"bus": "main", "node_id": 2, "eds": "", "counts_per_revolution": 1000, "gear_ratio": 1}
    table |= {"stop_timeout_s": WAIT_S, "poll_hz": 0, "slow_poll_hz": 0}
    joints = [
        JointDrive(f"axis_{axis}", JointSettings(**table, axis=axis), bus, eds.load(path, 2))  # type: ignore[arg-type]
        for axis in range(2)
    ]
    with FakeNode(channel, 2, objects) as fake:
        for one in joints:
            one.start()
        until(lambda: all(one.node.ready for one in joints))
        say(fake, S.OPERATION_ENABLED)
        yield fake, joints
        for one in joints:
            one.stop()


def stop_all(joints: list[JointDrive]) -> list[Future[StopOutcome]]:
    stops = [one.quick_stop(wake=False) for one in joints]
    for one in joints:
        one.wake()
    return stops


def test_both_axes_of_a_drive_are_asked_before_one_has_confirmed(
    axes: tuple[FakeNode, list[JointDrive]],
) -> None:
    fake, joints = axes
    stops = stop_all(joints)
    until(lambda: {0x6040, 0x6840} <= {index for index, _, _ in fake.writes}, "both were asked")
    assert not any(stop.done() for stop in stops)
    say(fake, S.QUICK_STOP_ACTIVE)
    assert {stop.result(WAIT_S) for stop in stops} == {StopOutcome.CONFIRMED}


@pytest.mark.parametrize("obeys", [0, 1])
def test_an_axis_that_holds_is_confirmed_while_another_one_ignores_its_stop(
    axes: tuple[FakeNode, list[JointDrive]], obeys: int
) -> None:
    fake, joints = axes
    fake.objects[0x6041 + 0x800 * obeys, 0] = statusword(S.QUICK_STOP_ACTIVE).to_bytes(2, "little")
    stops = stop_all(joints)
    until(stops[obeys].done)
    assert not stops[1 - obeys].done()
    assert stops[obeys].result() is StopOutcome.CONFIRMED
    say(fake, S.QUICK_STOP_ACTIVE)
    assert stops[1 - obeys].result(WAIT_S) is StopOutcome.CONFIRMED


def test_an_axis_that_is_stopped_later_is_asked_while_the_first_one_is_not_confirmed(
    axes: tuple[FakeNode, list[JointDrive]],
) -> None:
    fake, joints = axes
    first = joints[0].quick_stop()
    until(lambda: fake.writes)
    second = joints[1].quick_stop()
    until(lambda: 0x6840 in {index for index, _, _ in fake.writes}, "it was asked")
    assert not first.done()
    say(fake, S.QUICK_STOP_ACTIVE)
    assert {first.result(WAIT_S), second.result(WAIT_S)} == {StopOutcome.CONFIRMED}


def say(fake: FakeNode, state: DriveState) -> None:
    """Both axes say this state."""
    fake.objects[0x6041, 0] = fake.objects[0x6841, 0] = statusword(state).to_bytes(2, "little")


class TestWithoutABus:
    """A drive that answers in the worker's own thread, so that every request is at its place."""

    @pytest.fixture
    def drive(self) -> SdoDrive:
        return SdoDrive(S.OPERATION_ENABLED)

    @pytest.fixture
    def power(self, drive: SdoDrive) -> Iterator[PowerDrive]:
        worker = SdoWorker(drive.channel)
        worker.start()
        node = SimpleNamespace(run=worker.submit, wake=worker.wake, channel=drive.channel)
        settings = JointSettings(bus="main", node_id=2, eds="", counts_per_revolution=1000, gear_ratio=1)
        yield PowerDrive(cast("Node", node), settings)
        worker.stop()

    def test_a_newer_stop_is_asked_for_again_and_believes_no_read_of_before(
        self, drive: SdoDrive, power: PowerDrive
    ) -> None:
        requests: list[int] = []
        newer: list[Future[StopOutcome]] = []
        asked_ns = 0

        def hear(index: int) -> None:
            nonlocal asked_ns
            requests.append(index)
            if requests == [0x6040, 0x6041]:
                asked_ns = time.monotonic_ns()
                newer.append(power.quick_stop())

        drive.on_request = hear
        older = power.quick_stop()
        assert older.result(WAIT_S) is StopOutcome.CONFIRMED
        assert newer[0].result(WAIT_S) is StopOutcome.CONFIRMED
        assert requests[:3] == [0x6040, 0x6041, 0x6040]
        assert requests[3:].count(0x6041) == 3  # one for the older, two for the newer
        assert power.confirmed_ns > asked_ns

    def test_a_stop_that_is_not_confirmed_confirms_nothing(self, drive: SdoDrive, power: PowerDrive) -> None:
        drive.deaf_to = {0x0002}
        assert power.quick_stop().result(WAIT_S) is StopOutcome.UNCONFIRMED
        assert power.confirmed_ns == 0

    def test_a_look_sends_no_command(self, drive: SdoDrive, power: PowerDrive) -> None:
        led = power.look().result(WAIT_S)
        assert (led.state, led.problem) == (S.OPERATION_ENABLED, None)
        assert drive.written == []

    def test_a_look_waits_behind_a_stop_and_says_what_is_after_it(
        self, drive: SdoDrive, power: PowerDrive
    ) -> None:
        looks: list[Future[Led]] = []
        drive.on_request = lambda index: None if looks else looks.append(power.look())
        stopped = power.quick_stop()
        assert stopped.result(WAIT_S) is StopOutcome.CONFIRMED
        until(lambda: looks)
        led = looks[0].result(WAIT_S)
        assert led.state is S.QUICK_STOP_ACTIVE
        assert led.asked_ns > power.confirmed_ns
