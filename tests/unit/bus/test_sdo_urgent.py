"""Urgent jobs of a node's worker: what they interrupt, and what is sent ahead of them."""

import threading
from collections.abc import Callable

import pytest

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.errors import DeviceTimeout, Unavailable
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.direct import Direct
from tests.unit.bus.sdo_device import Device, stop, upload


def test_an_urgent_job_ends_the_transfer_in_flight_and_goes_first(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x1000] = 1
    device.channel.timeout_s = WAIT_S
    slow, queued = upload(worker, 0x1000), upload(worker, 0x1001)
    assert device.asked.wait(WAIT_S)
    urgent = worker.submit(lambda sdo: sdo.download(0x6040, 0, b"\x02\x00"), urgent=True)
    assert urgent.result(WAIT_S) is None
    assert slow.result(WAIT_S)[:2] == b"\x00\x10"
    assert queued.result(WAIT_S)[:2] == b"\x01\x10"
    assert device.commands() == ["40 1000", "80 1000", "2B 6040", "40 1000", "40 1001"]


def test_a_write_ended_by_an_urgent_job_is_unknown(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x6065] = 1
    device.channel.timeout_s = WAIT_S
    write = worker.submit(lambda sdo: sdo.download(0x6065, 0, bytes(4)))
    assert device.asked.wait(WAIT_S)
    upload(worker, 0x6041, urgent=True).result(WAIT_S)
    with pytest.raises(DeviceTimeout, match="interrupted by an urgent request; whether the device took it"):
        write.result(WAIT_S)
    assert device.commands() == ["23 6065", "80 6065", "40 6041"]


def test_a_request_ahead_is_sent_by_who_asks_and_only_once(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x1000] = 1
    device.channel.timeout_s = WAIT_S
    slow = upload(worker, 0x1000)
    assert device.asked.wait(WAIT_S)
    stopped = stop(worker, wake=False)
    assert device.commands()[:3] == [
        "40 1000",
        "80 1000",
        "2B 6040",
    ]  # sent, woken or not
    worker.wake()
    stopped.result(WAIT_S)
    assert slow.result(WAIT_S)[:2] == b"\x00\x10"
    assert device.commands() == ["40 1000", "80 1000", "2B 6040", "40 1000"]


def test_the_answer_to_a_request_ahead_is_not_lost_to_the_job_it_interrupts(
    worker: SdoWorker, device: Device
) -> None:
    """The device answers before the interrupted job looks into its inbox."""
    device.channel.timeout_s = WAIT_S
    for _ in range(20):
        device.deaf_to[0x1000] = 1
        device.asked.clear()
        slow = upload(worker, 0x1000)
        assert device.asked.wait(WAIT_S)
        stop(worker).result(WAIT_S)
        slow.result(WAIT_S)
    assert device.channel.counters.timeouts == 0
    assert device.commands().count("2B 6040") == 20


def test_nothing_of_the_interrupted_job_follows_a_request_ahead(worker: SdoWorker, device: Device) -> None:
    """Between its requests a job is not waiting: its next one must not go out behind a stop."""
    begun, go_on = threading.Event(), threading.Event()

    def job(sdo: SdoChannel) -> None:
        if not begun.is_set():
            begun.set()
            assert go_on.wait(WAIT_S)
        sdo.upload(0x1001, 0)

    running = worker.submit(job)
    assert begun.wait(WAIT_S)
    stopped = stop(worker)
    go_on.set()
    stopped.result(WAIT_S)
    running.result(WAIT_S)
    assert device.commands() == ["2B 6040", "40 1001"]


def test_a_second_urgent_job_does_not_disturb_the_first(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x6041] = 1
    device.channel.timeout_s = 0.2
    first = upload(worker, 0x6041, urgent=True)
    assert device.asked.wait(WAIT_S)
    stop(worker).result(WAIT_S)
    first.result(WAIT_S)
    assert device.commands() == ["40 6041", "80 6041", "40 1000", "40 6041", "2B 6040"]


def test_a_request_ahead_of_a_worker_that_ended_is_not_taken_for_sent_later(device: Device) -> None:
    worker = SdoWorker(device.channel)
    worker.start()
    device.deaf_to[0x6040] = 1
    device.channel.timeout_s = WAIT_S
    left = stop(worker)
    assert device.asked.wait(WAIT_S)
    worker.stop()
    with pytest.raises(Unavailable):
        left.result(WAIT_S)
    worker.start()
    stop(worker).result(WAIT_S)
    worker.stop()
    assert device.commands().count("2B 6040") == 2


# Urgent ones among themselves.


def test_urgent_jobs_are_done_in_the_order_in_which_they_were_asked_for(
    worker: SdoWorker, device: Device
) -> None:
    device.deaf_to[0x1000] = 1
    device.channel.timeout_s = WAIT_S
    running = upload(worker, 0x1000)
    assert device.asked.wait(WAIT_S)
    futures = [upload(worker, 0x2000 + at, urgent=at != 1) for at in range(4)]
    for future in (*futures, running):
        future.result(WAIT_S)
    assert device.commands()[2:] == ["40 2000", "40 2002", "40 2003", "40 1000", "40 2001"]


@pytest.mark.parametrize("within", [True, False])
def test_an_urgent_job_may_queue_itself_again_and_lets_the_others_have_their_turn(
    worker: SdoWorker, device: Device, within: bool
) -> None:
    """From within, or from a callback of its future; nobody is interrupted."""
    ended = threading.Semaphore(0)
    begun, go_on = threading.Event(), threading.Event()

    def look(index: int, left: int) -> None:
        def job(sdo: SdoChannel) -> None:
            begun.set()
            assert go_on.wait(WAIT_S)
            sdo.upload(index, 0, attempts=1)
            if within:
                again()
            sdo.upload(index, 1, attempts=1)

        def again() -> None:
            if left:
                look(index, left - 1)
            else:
                ended.release()

        future = worker.submit(job, urgent=True)
        if not within:
            future.add_done_callback(lambda _: again())

    look(0x6041, 2)
    assert begun.wait(WAIT_S)
    look(0x6841, 2)
    usual = upload(worker, 0x1000)
    go_on.set()
    assert ended.acquire(timeout=WAIT_S)
    assert ended.acquire(timeout=WAIT_S)
    usual.result(WAIT_S)
    assert device.commands() == [*["40 6041"] * 2, *["40 6841"] * 2] * 3 + ["40 1000"]


def test_a_stop_whose_job_was_cancelled_is_not_taken_for_the_next(worker: SdoWorker, device: Device) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def busy(_: SdoChannel) -> None:
        begun.set()
        assert go_on.wait(WAIT_S)

    running = worker.submit(busy)
    assert begun.wait(WAIT_S)
    assert stop(worker, wake=False).cancel()
    go_on.set()
    running.result(WAIT_S)
    worker.submit(lambda _: None).result(WAIT_S)
    stop(worker).result(WAIT_S)
    assert device.commands() == ["2B 6040", "2B 6040"]


def test_a_stop_that_a_broken_interface_does_not_send_is_tried_by_its_job(
    worker: SdoWorker, device: Device
) -> None:
    worker.submit(lambda _: None).result(WAIT_S)
    outlet = device.channel._outlet

    def broken(_request: bytes) -> None:
        device.channel._outlet = outlet
        raise OSError("the interface is broken")

    device.channel._outlet = Direct(broken)
    with pytest.raises(OSError, match="broken"):
        stop(worker)
    worker.submit(lambda _: None).result(WAIT_S)
    assert device.commands() == ["2B 6040"]


# Long jobs.


def test_a_long_job_goes_on_after_urgent_ones_and_keeps_what_it_has(
    worker: SdoWorker, device: Device
) -> None:
    device.deaf_to[0x1002] = 1
    device.channel.timeout_s = WAIT_S
    device.asked.clear()

    def long(sdo: SdoChannel) -> list[bytes]:
        return [sdo.upload(index, 0)[:2] for index in (0x1001, 0x1002, 0x1003)]

    running = worker.submit(long, current=lambda: True)
    until(lambda: "40 1002" in device.commands())
    stop(worker).result(WAIT_S)
    assert running.result(WAIT_S) == [b"\x01\x10", b"\x02\x10", b"\x03\x10"]
    assert device.commands() == ["40 1001", "40 1002", "80 1002", "2B 6040", "40 1002", "40 1003"]


def test_a_write_of_a_long_job_that_was_under_way_is_unknown(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x6065] = 1
    device.channel.timeout_s = WAIT_S
    write = worker.submit(lambda sdo: sdo.download(0x6065, 0, bytes(4)), current=lambda: True)
    assert device.asked.wait(WAIT_S)
    stop(worker).result(WAIT_S)
    with pytest.raises(DeviceTimeout, match="interrupted by an urgent request; whether the device took it"):
        write.result(WAIT_S)


def test_a_write_of_a_long_job_that_was_not_under_way_is_sent_afterwards(
    worker: SdoWorker, device: Device
) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def long(sdo: SdoChannel) -> None:
        begun.set()
        assert go_on.wait(WAIT_S)
        sdo.download(0x6065, 0, bytes(4))

    running = worker.submit(long, current=lambda: True)
    assert begun.wait(WAIT_S)
    stopped = stop(worker)
    go_on.set()
    running.result(WAIT_S)
    stopped.result(WAIT_S)
    assert device.commands() == ["2B 6040", "23 6065"]


def test_a_long_job_that_has_become_worthless_ends_at_its_next_transfer(
    worker: SdoWorker, device: Device
) -> None:
    current = threading.Event()
    current.set()

    def long(sdo: SdoChannel) -> None:
        sdo.upload(0x1000, 0)
        current.clear()
        sdo.upload(0x1001, 0)

    with pytest.raises(Unavailable, match="began anew"):
        worker.submit(long, current=current.is_set).result(WAIT_S)
    assert device.commands() == ["40 1000"]
    assert upload(worker, 0x1002).result(WAIT_S)


def test_a_worker_that_ends_during_a_long_job_ends_it_and_what_is_urgent(device: Device) -> None:
    worker = SdoWorker(device.channel)
    worker.start()
    device.deaf_to = {0x1000: 1, 0x6041: 1}
    device.channel.timeout_s = WAIT_S
    long = worker.submit(lambda sdo: sdo.upload(0x1000, 0), current=lambda: True)
    assert device.asked.wait(WAIT_S)
    urgent = upload(worker, 0x6041, urgent=True)
    until(lambda: "40 6041" in device.commands())
    worker.stop()
    for future in (long, urgent):
        with pytest.raises(Unavailable, match="not open"):
            future.result(WAIT_S)


class Full:
    """A bus that takes nothing: who offered a frame waits for it; an urgent one is put down."""

    def __init__(self) -> None:
        self.waits, self.gone = threading.Event(), threading.Event()
        self.urgent: list[bytes] = []

    def offer(self, data: bytes, wanted: Callable[[], bool]) -> Callable[[], bool]:
        def sent() -> bool:
            self.waits.set()
            self.gone.wait(WAIT_S)
            raise Unavailable("closed")

        return sent

    def send_urgent(self, data: bytes) -> bool:
        self.urgent.append(data)
        return False


def test_an_urgent_request_waits_for_no_bus_that_takes_nothing() -> None:
    """Who stops the drives of several buses stands still at none of them."""
    full = Full()
    worker = SdoWorker(SdoChannel("node 1", full, timeout_s=0.2))
    worker.start()
    upload(worker, 0x2000)
    assert full.waits.wait(WAIT_S)
    quick_stop = bytes.fromhex("2B 40 60 00 02 00 00 00")
    stop = threading.Thread(
        target=lambda: worker.submit(lambda sdo: sdo.upload(0x6041, 0), urgent=True, ahead=quick_stop)
    )
    stop.start()
    stop.join(WAIT_S / 2)
    stands = stop.is_alive()
    full.gone.set()
    stop.join()
    worker.stop()
    assert not stands
    assert [frame[:4].hex(" ") for frame in full.urgent[:2]] == ["80 00 20 00", "2b 40 60 00"]
