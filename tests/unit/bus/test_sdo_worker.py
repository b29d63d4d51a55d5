"""One worker a node: order, urgency, repetition, and what happens when it ends."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future

import pytest

from drivers.bus.sdo_channel import SdoChannel
from drivers.bus.sdo_worker import SdoWorker
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable

WAIT_S = 10.0


class Device:
    """Answers uploads and downloads of four bytes; some objects stay unanswered."""

    def __init__(self) -> None:
        self.requests: list[bytes] = []
        self.deaf_to: dict[int, int] = {}  # index: how many requests stay unanswered
        self.asked = threading.Event()
        self.channel = SdoChannel("node 1", self.hear, timeout_s=0.2)

    def hear(self, request: bytes) -> None:
        self.requests.append(request)
        self.asked.set()
        index = int.from_bytes(request[1:3], "little")
        if request[0] == 0x80:
            return
        if self.deaf_to.get(index, 0) > 0:
            self.deaf_to[index] -= 1
            return
        reply = (
            b"\x43" + request[1:4] + request[1:3] + b"\0\0" if request[0] == 0x40 else b"\x60" + request[1:4]
        )
        self.channel.on_response(0, reply.ljust(8, b"\0"))

    def commands(self) -> list[str]:
        return [f"{request[0]:02X} {int.from_bytes(request[1:3], 'little'):04X}" for request in self.requests]


@pytest.fixture
def device() -> Device:
    return Device()


@pytest.fixture
def worker(device: Device) -> Iterator[SdoWorker]:
    worker = SdoWorker(device.channel)
    worker.start()
    yield worker
    worker.stop()


def upload(worker: SdoWorker, index: int, *, urgent: bool = False) -> Future[bytes]:
    return worker.submit(lambda sdo: sdo.upload(index, 0), urgent=urgent)


def test_jobs_are_done_in_their_order(worker: SdoWorker, device: Device) -> None:
    futures = [upload(worker, index) for index in (0x1000, 0x1001, 0x1002)]
    assert [future.result(WAIT_S)[:2] for future in futures] == [b"\x00\x10", b"\x01\x10", b"\x02\x10"]
    assert device.commands() == ["40 1000", "40 1001", "40 1002"]


def test_a_read_that_stays_unanswered_is_repeated(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x1000] = 2
    assert upload(worker, 0x1000).result(WAIT_S)[:2] == b"\x00\x10"
    lost, another = ["40 1000", "80 1000"], ["40 1018"]
    assert device.commands() == [*lost, *another, *lost, "40 1001", "40 1000"]
    assert device.channel.counters.timeouts == device.channel.counters.resyncs == 2


def test_a_write_that_stays_unanswered_is_never_repeated(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x6065] = 1
    future = worker.submit(lambda sdo: sdo.download(0x6065, 0, (5000).to_bytes(4, "little")))
    with pytest.raises(
        DeviceTimeout, match=r"node 1: writing 5000 .*0x6065:00.*no answer within 0.2 s.*read it"
    ):
        future.result(WAIT_S)
    assert device.commands() == ["23 6065", "80 6065"]


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


def test_an_abort_is_told_in_words_with_object_and_value(worker: SdoWorker, device: Device) -> None:
    def refuse(request: bytes) -> None:
        device.channel.on_response(0, b"\x80" + request[1:4] + (0x06090031).to_bytes(4, "little"))

    device.channel._send = refuse
    future = worker.submit(lambda sdo: sdo.download(0x6065, 1, (5000).to_bytes(2, "little")))
    with pytest.raises(
        DeviceAbort, match=r"writing 5000 \(88 13\) to 0x6065:01: refused, the value is too high"
    ):
        future.result(WAIT_S)


def test_an_answer_left_from_before_is_thrown_away(worker: SdoWorker, device: Device) -> None:
    device.channel.on_response(0, bytes.fromhex("43 00 10 00 AA AA AA AA"))
    assert upload(worker, 0x1000).result(WAIT_S)[:2] == b"\x00\x10"
    assert device.channel.counters.stale == 1


def test_a_repeated_job_runs_until_it_is_ended(worker: SdoWorker) -> None:
    runs = threading.Semaphore(0)
    end = worker.repeat(0.001, lambda _: runs.release())
    for _ in range(5):
        assert runs.acquire(timeout=WAIT_S)
    end()
    worker.submit(lambda _: None).result(WAIT_S)
    while runs.acquire(blocking=False):
        pass
    worker.submit(lambda _: None).result(WAIT_S)
    assert not runs.acquire(blocking=False)


def test_an_error_of_a_job_belongs_to_its_future_and_the_worker_lives_on(worker: SdoWorker) -> None:
    def broken(_: SdoChannel) -> None:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        worker.submit(broken).result(WAIT_S)
    assert worker.submit(lambda _: 1).result(WAIT_S) == 1


def test_a_cancelled_job_is_not_done(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x1000] = 1
    first = upload(worker, 0x1000)
    assert device.asked.wait(WAIT_S)
    second = upload(worker, 0x1001)
    assert second.cancel()
    first.result(WAIT_S)
    upload(worker, 0x1002).result(WAIT_S)
    assert "40 1001" not in device.commands()


def test_what_is_left_at_the_end_fails_as_unavailable(device: Device) -> None:
    worker = SdoWorker(device.channel)
    worker.start()
    device.deaf_to[0x1000] = 1
    device.channel.timeout_s = WAIT_S
    futures = [upload(worker, 0x1000), upload(worker, 0x1001)]
    assert device.asked.wait(WAIT_S)
    worker.stop()
    for future in (*futures, upload(worker, 0x1002)):
        with pytest.raises(Unavailable, match="not open"):
            future.result(WAIT_S)


def test_a_worker_can_be_started_again(device: Device) -> None:
    worker = SdoWorker(device.channel)
    for _ in range(2):
        worker.start()
        assert upload(worker, 0x1000).result(WAIT_S)
        worker.stop()


def test_a_write_may_be_given_more_time_than_others(worker: SdoWorker, device: Device) -> None:
    device.deaf_to[0x1010] = 1
    later = threading.Timer(2 * device.channel.timeout_s, lambda: device.hear(device.requests[-1]))
    stored = worker.submit(lambda sdo: sdo.download(0x1010, 1, b"save", timeout_s=WAIT_S))
    later.start()
    stored.result(WAIT_S)
    later.join()
    assert device.commands() == ["23 1010", "23 1010"]  # the second is the timer's
    assert device.channel.counters.timeouts == 0


STOP = bytes.fromhex("2B 40 60 00 02 00 00 00")


def stop(worker: SdoWorker, *, wake: bool = True) -> Future[None]:
    def job(sdo: SdoChannel) -> None:
        sdo.download(0x6040, 0, b"\x02\x00")

    return worker.submit(job, urgent=True, ahead=STOP, wake=wake)


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
