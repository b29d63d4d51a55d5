"""A write is permitted at the last moment, so that none follows the stop that forbids it."""

import contextlib
import itertools
import threading
from collections.abc import Callable, Iterator

import pytest

from drivers.bus.sdo.channel import Interrupted, SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.errors import DeviceTimeout, DriverError, NotPermitted
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.direct import Direct
from tests.unit.bus.late_server import VALUE, LateServer

STOP = bytes.fromhex("2B 40 60 00 02 00 00 00")
CONTROLWORD = 0x6040


class Machine:
    """What a stop forbids: it changes its state first, and sends then."""

    def __init__(self) -> None:
        self.server = LateServer(timeout_s=WAIT_S)
        self.worker = SdoWorker(self.server.channel)
        self.stopped = False

    def permitted(self) -> str | None:
        return "a stop is held" if self.stopped else None

    def write(self, sdo: SdoChannel) -> None:
        sdo.download(VALUE, 0, b"\1\0\0\0", permitted=self.permitted)

    def stop(self) -> None:
        def job(sdo: SdoChannel) -> None:
            sdo.download(CONTROLWORD, 0, b"\x02\x00")

        self.stopped = True
        self.worker.submit(job, urgent=True, ahead=STOP)


@pytest.fixture
def machine() -> Iterator[Machine]:
    machine = Machine()
    machine.worker.start()
    yield machine
    machine.worker.stop()


def test_a_write_that_is_permitted_is_sent(machine: Machine) -> None:
    machine.worker.submit(machine.write).result(WAIT_S)
    assert machine.server.asked() == [VALUE]


def test_a_write_that_is_not_is_not_sent_and_says_why(machine: Machine) -> None:
    machine.stopped = True
    with pytest.raises(NotPermitted, match=r"writing 1 .*0x2001:00: not sent: a stop is held"):
        machine.worker.submit(machine.write).result(WAIT_S)
    assert machine.server.asked() == []
    assert not machine.server.channel.is_unsure(VALUE, 0)
    assert issubclass(NotPermitted, DriverError)


def test_a_stop_during_the_decision_goes_out_behind_the_write_and_nothing_behind_the_stop(
    machine: Machine,
) -> None:
    """Between the last permission and the frame there is no room for a stop."""
    stops: list[threading.Thread] = []
    decisions = itertools.count(1)

    def slowly() -> str | None:
        may = machine.permitted()
        if next(decisions) == 2:  # it is asked before it is offered to the bus, and when its turn has come
            stops.append(threading.Thread(target=machine.stop))
            stops[0].start()
            until(lambda: machine.stopped)
            stops[0].join(0.05)  # as long as it might need, if nothing held it
        return may

    def write(sdo: SdoChannel) -> None:
        sdo.download(VALUE, 0, b"\1\0\0\0", permitted=slowly)

    futures = [machine.worker.submit(write) for _ in range(3)]
    errors = [future.exception(WAIT_S) for future in futures]
    stops[0].join()
    machine.worker.submit(lambda _: None).result(WAIT_S)
    assert machine.server.asked() == [VALUE, CONTROLWORD]
    assert [isinstance(error, NotPermitted) for error in errors[1:]] == [True, True]


def test_whenever_a_stop_comes_no_write_follows_it(machine: Machine) -> None:
    for _ in range(50):
        machine.stopped = False
        before = len(machine.server.asked())
        writes = [machine.worker.submit(machine.write) for _ in range(4)]
        stopping = threading.Thread(target=machine.stop)
        stopping.start()
        for write in writes:
            write.exception(WAIT_S)
        stopping.join()
        machine.worker.submit(lambda _: None).result(WAIT_S)
        assert machine.server.asked()[before:][-1] == CONTROLWORD


def test_it_is_asked_for_each_segment_of_a_write(machine: Machine) -> None:
    """A stop that does not concern this device does not interrupt its channel."""
    asked: list[int] = []

    def permitted() -> str | None:
        asked.append(len(machine.server.requests))
        return None

    def write(sdo: SdoChannel) -> None:
        sdo.download(VALUE, 0, bytes(20), permitted=permitted)

    machine.worker.submit(write).result(WAIT_S)
    assert asked == [0, 0, 1, 1, 2, 2, 3, 3]  # before it is offered to the bus, and when its turn has come
    assert len(machine.server.requests) == 4


@pytest.mark.parametrize("asked", [3, 4, 7, 8])
def test_a_write_that_is_no_longer_permitted_is_aborted_and_unknown(machine: Machine, asked: int) -> None:
    """Before a segment, the last one too: whichever the device has, none follows the stop."""
    decisions = itertools.count(1)
    heard: list[bytes] = []

    def hear(frame: bytes) -> None:
        heard.append(frame)
        machine.server.hear(frame)

    channel = machine.server.channel = SdoChannel("node 1", Direct(hear), WAIT_S)

    def permitted() -> str | None:
        machine.stopped = machine.stopped or next(decisions) == asked
        return machine.permitted()

    with pytest.raises(
        DeviceTimeout, match=r"0x2001:00: ended: a stop is held; whether the device took it is"
    ):
        channel.download(VALUE, 0, bytes(20), permitted=permitted)
    assert len(machine.server.requests) == (asked - 1) // 2
    assert heard[-1] == bytes.fromhex("80 01 20 00 00 00 00 08")
    assert channel.is_unsure(VALUE, 0)


def test_a_stop_is_sent_whoever_answers() -> None:
    server = LateServer()
    channel = SdoChannel("node 1", Direct(server.hear), WAIT_S, lambda: "two devices answer")
    server.channel = channel
    worker = SdoWorker(channel)
    worker.start()
    with pytest.raises(NotPermitted, match="two devices answer"):
        worker.submit(lambda sdo: sdo.download(CONTROLWORD, 0, b"\x0f\x00")).result(WAIT_S)
    worker.submit(lambda sdo: sdo.download(CONTROLWORD, 0, b"\x02\x00"), urgent=True, ahead=STOP).result(
        WAIT_S
    )
    worker.submit(lambda sdo: sdo.download(CONTROLWORD, 0, b"\x02\x00"), urgent=True).result(WAIT_S)
    worker.stop()
    assert server.requests == [STOP, STOP]


def test_a_stop_that_overtakes_a_write_leaves_nothing_known_of_the_controlword() -> None:
    """What was to be written did not leave, and what was stopped with is not confirmed yet."""

    class Queue:
        """A bus whose queue is only looked at when it is told to."""

        def __init__(self) -> None:
            self.turn, self.queued = threading.Event(), threading.Event()

        def offer(self, data: bytes, wanted: Callable[[], bool]) -> Callable[[], bool]:
            def sent() -> bool:
                self.queued.set()
                self.turn.wait(WAIT_S)
                return wanted()

            return sent

        def send_urgent(self, data: bytes) -> bool:
            return True

    bus = Queue()
    channel = SdoChannel("node 1", bus, timeout_s=0.2)
    channel._written.begin((CONTROLWORD, 0))
    channel._written.confirm((CONTROLWORD, 0), b"\x0f\x00")
    write = threading.Thread(target=lambda: _quietly(lambda: channel.download(CONTROLWORD, 0, b"\x0f\x00")))
    write.start()
    assert bus.queued.wait(WAIT_S)
    channel.interrupt(STOP)
    bus.turn.set()
    write.join()
    assert channel.known(CONTROLWORD, 0) is None
    assert channel.is_unsure(CONTROLWORD, 0)


def _quietly(work: Callable[[], object]) -> None:
    with contextlib.suppress(Interrupted, DriverError):
        work()
