"""A node comes up although urgent jobs keep coming, and never with what it was before it began anew."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager

import pytest

from drivers.bus.bus import CanBus
from drivers.bus.device import CanDevice
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import DeviceSettings
from drivers.errors import DeviceTimeout
from eds import Description
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[[int], Description]

MAPPING, ENTRIES = 0x1A00, 80
OBJECTS = {
    **IDENTITY,
    **{(MAPPING, at): bytes([at]) for at in range(ENTRIES)},
    (0x6040, 0): bytes(2),
    (0x6041, 0): b"\x40\x00",
}
STOP = bytes.fromhex("2B 40 60 00 02 00 00 00")


class Drive:
    """A user whose boot reads a lot."""

    def __init__(self) -> None:
        self.begun = 0
        self.booted: list[list[bytes]] = []
        self.forgotten = 0
        self.writes = False

    def boot(self, sdo: SdoChannel) -> None:
        self.begun += 1
        read = [sdo.upload(MAPPING, at) for at in range(ENTRIES)]
        if self.writes:
            sdo.download(MAPPING, 0, b"\0")
        self.booted.append(read)

    def forget(self) -> None:
        self.forgotten += 1


@pytest.fixture
def gait(bus: CanBus, describe: Describe) -> CanDevice:
    settings = DeviceSettings(bus="main", node_id=5, eds="small.eds", sdo_timeout_s=5.0)
    return CanDevice("gait", settings, bus, describe(5))


@pytest.fixture
def drive(gait: CanDevice) -> Iterator[Drive]:
    """Attached to the node; a test lets it go itself or not."""
    drive = Drive()
    yield drive
    gait.node.detach(drive)


def stop(gait: CanDevice) -> Future[None]:
    """As a held stop does: the controlword, then the statusword twice."""

    def ask(sdo: SdoChannel) -> None:
        try:
            sdo.download(0x6040, 0, b"\x02\x00")
        except DeviceTimeout:
            return

    def confirm(sdo: SdoChannel) -> None:
        for _ in range(2):
            sdo.upload(0x6041, 0, attempts=1)

    gait.node.run(ask, urgent=True, ahead=STOP)
    return gait.node.run(confirm, urgent=True)


@contextmanager
def stopping(gait: CanDevice, every_s: float) -> Iterator[None]:
    ended = threading.Event()

    def repeatedly() -> None:
        running: Future[None] | None = None
        while not ended.wait(every_s):
            if running is None or running.done():
                running = stop(gait)

    thread = threading.Thread(target=repeatedly)
    thread.start()
    yield
    ended.set()
    thread.join()


@pytest.mark.parametrize("answer_s", [0.005, 0.04])
def test_a_node_comes_up_though_a_held_stop_asks_it_four_times_a_second(
    gait: CanDevice, drive: Drive, channel: str, answer_s: float
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), delay_s=answer_s), stopping(gait, 0.25):
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready, "it comes up", within_s=4 * WAIT_S)
    assert drive.booted == [[bytes([at]) for at in range(ENTRIES)]]
    assert drive.begun == 1


def test_what_is_wrong_with_the_answers_of_a_device_is_told_of_it(
    gait: CanDevice, drive: Drive, channel: str
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS)):
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready, "it comes up")
        for second in (1, 2, 3):
            gait.node.channel.round_trips.unanswered(second * 1_000_000_000)
        quality = gait.quality(9_000_000_000)
    (finding,) = quality.findings
    assert (finding.since_ns, finding.words) == (1_000_000_000, "it answers no SDO, 3 requests in a row")
    assert "3 requests in a row (for 8 s): is another SDO client" in str(quality.problem)


def test_a_boot_goes_on_where_it_was_interrupted(gait: CanDevice, drive: Drive, channel: str) -> None:
    """At every second object."""
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        interrupted: set[bytes] = set()

        def interrupt(request: bytes) -> None:
            if (
                request[0] == 0x40
                and request[2] == MAPPING >> 8
                and request[3] % 2
                and request not in interrupted
            ):
                interrupted.add(request)
                stop(gait)

        fake.on_request = interrupt
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready, "it comes up")
        assert len(interrupted) == ENTRIES // 2
        assert fake.writes.count((0x6040, 0, b"\x02\x00")) == ENTRIES // 2
    assert drive.booted == [[bytes([at]) for at in range(ENTRIES)]]
    assert (drive.begun, gait.node.boots_begun) == (1, 1)


def test_what_is_urgent_is_done_during_a_boot_and_in_its_order(
    gait: CanDevice, drive: Drive, channel: str
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), delay_s=0.005) as fake:
        gait.node.attach(drive, "drive")
        until(lambda: len(fake.requests) > ENTRIES // 4)
        done: list[int] = []
        futures = [gait.node.run(lambda _, n=n: done.append(n), urgent=True) for n in range(5)]  # type: ignore[misc]
        for future in futures:
            future.result(WAIT_S)
        assert done == [0, 1, 2, 3, 4]
        assert not gait.node.ready
        until(lambda: gait.node.ready)


def test_a_write_of_a_boot_that_is_interrupted_is_unknown_and_the_boot_tried_again(
    gait: CanDevice, drive: Drive, channel: str
) -> None:
    drive.writes = True
    with FakeNode(channel, 5, dict(OBJECTS), deaf_to=set()) as fake:

        def interrupt(request: bytes) -> None:
            if request[0] & 0xE0 == 0x20 and request[2] == MAPPING >> 8 and drive.begun == 1:
                stop(gait)

        fake.on_request = interrupt
        fake.delay_s = 0.005
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready, "it comes up")
        assert drive.begun == 2
        assert fake.objects[MAPPING, 0] == b"\0"
    assert len(drive.booted) == 1


def test_a_boot_that_a_reboot_overtakes_is_given_up_and_not_finished(
    gait: CanDevice, drive: Drive, channel: str
) -> None:
    """Half of what it reads would be from before, and half from after."""
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:

        def reboot(request: bytes) -> None:
            if request == b"\x40\x00\x1a" + bytes([ENTRIES // 2]) + bytes(4) and drive.begun == 1:
                fake.objects.update({(MAPPING, at): b"\xff" for at in range(ENTRIES)})
                fake.boot_up()

        fake.on_request = reboot
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready, "it comes up")
    assert drive.booted == [[b"\xff"] * ENTRIES]
    assert drive.begun == 2


def test_each_attempt_to_boot_is_counted(gait: CanDevice, drive: Drive, channel: str) -> None:
    """Who holds a stop may ask a node once for each."""
    with FakeNode(channel, 5, dict(OBJECTS), silent=True) as fake:
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.boots_begun >= 2)
        assert not gait.node.comes_up
        fake.silent = False
        until(lambda: gait.node.ready)
        begun = gait.node.boots_begun
        fake.boot_up()
        until(lambda: gait.node.boots_begun > begun and gait.node.ready)


def test_an_error_that_no_driver_should_make_is_told_and_tried_again(
    gait: CanDevice, drive: Drive, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def boot(_sdo: SdoChannel) -> None:
        drive.begun += 1
        if drive.begun < 3:
            raise IndexError("list index out of range")

    monkeypatch.setattr(drive, "boot", boot)
    with FakeNode(channel, 5, dict(OBJECTS)):
        gait.node.attach(drive, "drive")
        words = "internal error: IndexError: list index out of range"
        until(lambda: gait.node.problem(time.monotonic_ns()) == words)
        until(lambda: gait.node.ready)


def test_a_node_that_boots_anew_tells_nothing_of_what_was_wrong_before(
    gait: CanDevice, drive: Drive, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor that it was never tried, while its first answers are on their way."""
    goes_on = threading.Event()

    def boot(_sdo: SdoChannel) -> None:
        drive.begun += 1
        if drive.begun == 1:
            raise DeviceTimeout("the mapping is unreadable")
        if drive.begun == 3:
            goes_on.wait(WAIT_S)

    monkeypatch.setattr(drive, "boot", boot)
    with FakeNode(channel, 5, dict(OBJECTS)) as fake:
        gait.node.attach(drive, "drive")
        until(lambda: gait.node.ready)
        fake.boot_up()
        until(lambda: drive.begun == 3)
        try:
            assert gait.node.problem(time.monotonic_ns()) == "it was not read yet: look again in a moment"
            assert gait.node.comes_up
        finally:
            goes_on.set()
        until(lambda: gait.node.ready)
        assert not gait.node.comes_up


def test_a_node_that_is_let_go_in_the_middle_of_its_boot_ends(
    gait: CanDevice, drive: Drive, channel: str
) -> None:
    with FakeNode(channel, 5, dict(OBJECTS), delay_s=0.005) as fake, stopping(gait, 0.02):
        gait.node.attach(drive, "drive")
        until(lambda: len(fake.requests) > 10)
        gait.node.detach(drive)
    assert drive.booted == []
