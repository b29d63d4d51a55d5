"""One worker a node: order, repetition, and what happens when it ends."""

import threading

import pytest

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from tests.support.waiting import WAIT_S
from tests.unit.bus.direct import Direct
from tests.unit.bus.sdo_device import Device, upload


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


def test_what_else_may_be_silent_stands_in_the_words_of_a_time_out(worker: SdoWorker, device: Device) -> None:
    device.channel.also_silent = "; is it the simulator?"
    device.deaf_to[0x1000] = 9
    with pytest.raises(DeviceTimeout, match=r"no answer within 0.2 s; is it the simulator\?"):
        upload(worker, 0x1000).result(WAIT_S)


def test_an_abort_is_told_in_words_with_object_and_value(worker: SdoWorker, device: Device) -> None:
    def refuse(request: bytes) -> None:
        device.channel.on_response(0, b"\x80" + request[1:4] + (0x06090031).to_bytes(4, "little"))

    device.channel._outlet = Direct(refuse)
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


def test_a_repeated_job_that_only_waits_is_not_done_after_its_end(worker: SdoWorker) -> None:
    first, runs = threading.Semaphore(0), list[None]()
    ends = [worker.repeat(WAIT_S, lambda _: first.release())]

    def busy(_: SdoChannel) -> None:
        ends.append(worker.repeat(WAIT_S, lambda _: runs.append(None)))

    def end_it(_: SdoChannel) -> None:
        ends[1]()

    assert first.acquire(timeout=WAIT_S)
    futures = [worker.submit(busy), worker.submit(end_it), worker.submit(lambda _: None)]
    for future in futures:
        future.result(WAIT_S)
    assert runs == []
