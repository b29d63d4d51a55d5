"""Frames leave at once where they can; what waits is in nobody's way, and the most urgent leaves first."""

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from drivers.bus import sender as senders
from drivers.bus.bus import CanBus
from drivers.bus.frames import Transport
from drivers.bus.sender import Sender
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.narrow import NarrowTransport

FOREVER = 1000.0  # longer than any test may take: who waits for it has failed
REQUEST = 0x602
ABORT = bytes.fromhex("80 64 60 00 00 00 00 08")
QUICK_STOP = bytes.fromhex("2B 40 60 00 02 00 00 00")
DISABLE_VOLTAGE = bytes.fromhex("2B 40 60 00 00 00 00 00")
OTHER_AXIS = bytes.fromhex("2B 40 68 00 02 00 00 00")
ME = threading.main_thread().name


@pytest.fixture
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is given up, so that what waits for a time-out never ends."""
    monkeypatch.setattr(senders, "SEND_TIMEOUT_S", FOREVER)
    monkeypatch.setattr(senders, "URGENT_S", FOREVER)
    monkeypatch.setattr(senders, "ROOM_S", FOREVER)


@contextmanager
def sending(transport: Transport) -> Iterator[Sender]:
    sender = Sender("main", lambda: "bus main is not open")
    sender.start(transport)
    try:
        yield sender
    finally:
        sender.stop()
        transport.close()
        sender.join()


@pytest.fixture
def narrow() -> NarrowTransport:
    return NarrowTransport()


@pytest.fixture
def sender(narrow: NarrowTransport) -> Iterator[Sender]:
    with sending(narrow) as sender:
        yield sender


@pytest.fixture
def later(sender: Sender) -> Iterator[Callable[..., Future[bool]]]:
    """Sends in a thread of its own, and returns when the frame waits there."""
    with ThreadPoolExecutor(16) as threads:

        def send(can_id: int, data: bytes, wanted: Callable[[], bool] = lambda: True) -> Future[bool]:
            waiting = len(sender._normal)
            sent = threads.submit(lambda: sender.offer(can_id, data, wanted)())
            until(lambda: len(sender._normal) > waiting)
            return sent

        yield send
        sender.stop()


def test_a_frame_leaves_in_its_callers_own_thread(narrow: NarrowTransport, sender: Sender) -> None:
    narrow.open()
    sender.send(0x601, b"\x01")
    assert sender.send_urgent(0x602, b"\x02\x03")
    assert narrow.sent == [(0x601, b"\x01"), (0x602, b"\x02\x03")]
    assert narrow.threads == [ME, ME]
    assert (sender.sent, sender.sent_bytes) == (2, 3)


def test_a_frame_that_nobody_takes_is_taken_back_and_its_caller_told(
    narrow: NarrowTransport, sender: Sender
) -> None:
    with pytest.raises(Unavailable, match="does anybody on the bus acknowledge"):
        sender.send(0x601, b"\x01")
    narrow.open()
    sender.send(0x602, b"\x02")
    assert narrow.sent == [(0x602, b"\x02")]


def test_what_waits_leaves_as_soon_as_there_is_room_in_the_order_in_which_it_came(
    narrow: NarrowTransport, sender: Sender, later: Callable[..., Future[bool]], patient: None
) -> None:
    waiting = [later(REQUEST, bytes([number])) for number in range(8)]
    assert not any(one.done() for one in waiting)
    narrow.open()
    for one in waiting:
        one.result(WAIT_S)
    assert narrow.sent == [(REQUEST, bytes([number])) for number in range(8)]


def test_an_urgent_frame_never_waits_and_leaves_before_all_that_does(
    narrow: NarrowTransport, sender: Sender, later: Callable[..., Future[bool]], patient: None
) -> None:
    normal = later(REQUEST, b"normal")
    assert not sender.send_urgent(REQUEST, ABORT)
    assert not sender.send_urgent(REQUEST, QUICK_STOP)
    narrow.open()
    normal.result(WAIT_S)
    assert narrow.sent == [(REQUEST, ABORT), (REQUEST, QUICK_STOP), (REQUEST, b"normal")]


def test_an_urgent_frame_is_taken_at_once_though_others_wait(
    narrow: NarrowTransport, sender: Sender, later: Callable[..., Future[bool]], patient: None
) -> None:
    later(REQUEST, b"normal")
    until(lambda: narrow.awaited)
    narrow.room = 1  # of which the sender's thread does not know yet
    assert sender.send_urgent(REQUEST, QUICK_STOP)
    assert narrow.sent == [(REQUEST, QUICK_STOP)]
    assert narrow.threads == [ME]


class Patience(threading.Event):
    """Of a frame: who waits for it gives up only when the sender's thread has got as far as `reached`."""

    def __init__(self, reached: Callable[[], object]) -> None:
        super().__init__()
        self._reached = reached

    def wait(self, timeout: float | None = None) -> bool:
        until(lambda: self.is_set() or self._reached())
        return super().wait(timeout)


def offered(sender: Sender, can_id: int, data: bytes, reached: Callable[[], object]) -> Callable[[], bool]:
    """What sends a frame, with that patience."""
    send = sender.offer(can_id, data)
    sender._normal[-1].settled = Patience(reached)
    return send


class Hesitant(NarrowTransport):
    """It has no room twice, and takes its time to find out the second time."""

    def __init__(self) -> None:
        super().__init__(room=1000)
        self.begun, self.go_on = threading.Event(), threading.Event()

    def try_send(self, can_id: int, data: bytes) -> bool:
        self.asked += 1
        if self.asked == 2:
            self.begun.set()
            self.go_on.wait(WAIT_S)
        return self.asked > 2 and super().try_send(can_id, data)


def test_what_its_caller_was_told_that_nobody_sends_does_not_leave_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two SYNCs a millisecond apart would move setpoints twice."""
    monkeypatch.setattr(senders, "SEND_TIMEOUT_S", 0.05)
    monkeypatch.setattr(senders, "ROOM_S", WAIT_S)
    hesitant = Hesitant()
    with sending(hesitant) as sender, ThreadPoolExecutor(1) as threads:
        first = threads.submit(offered(sender, 0x80, b"first", hesitant.begun.is_set))
        until(lambda: first.done() or (sender._in_hand is not None and sender._in_hand.given_up))
        hesitant.go_on.set()
        with pytest.raises(Unavailable, match=r"acknowledge\?$"):
            first.result(WAIT_S)
        sender.send(0x80, b"second")
    assert hesitant.sent == [(0x80, b"second")]


def test_a_wish_that_fails_is_its_owners_alone(
    narrow: NarrowTransport, sender: Sender, patient: None
) -> None:
    def fails() -> bool:
        raise ZeroDivisionError("oops")

    first = sender.offer(0x601, b"first")
    wish = sender.offer(0x602, b"wish", fails)
    narrow.open()
    sender.send(0x603, b"last")
    with pytest.raises(Unavailable, match="internal error: ZeroDivisionError: oops"):
        wish()
    assert first()
    assert narrow.sent == [(0x601, b"first"), (0x603, b"last")]


class Held(NarrowTransport):
    """Whoever sends is held up in the middle of it, as by other programs and threads."""

    def __init__(self) -> None:
        super().__init__(room=1000)
        self.begun, self.go_on = threading.Event(), threading.Event()

    def try_send(self, can_id: int, data: bytes) -> bool:
        taken = super().try_send(can_id, data)
        if not self.begun.is_set():
            self.begun.set()
            self.go_on.wait(WAIT_S)
        return taken


def test_an_urgent_frame_waits_for_nobody_who_is_sending_and_leaves_next(patient: None) -> None:
    held = Held()
    with sending(held) as sender, ThreadPoolExecutor(2) as threads:
        first = threads.submit(sender.send, REQUEST, b"first")
        assert held.begun.wait(WAIT_S)
        second = threads.submit(sender.send, REQUEST, b"second")
        until(lambda: sender._normal)
        assert not sender.send_urgent(REQUEST, QUICK_STOP)
        held.go_on.set()
        first.result(WAIT_S)
        second.result(WAIT_S)
    assert held.sent == [(REQUEST, b"first"), (REQUEST, QUICK_STOP), (REQUEST, b"second")]


def test_a_newer_urgent_request_about_the_same_object_takes_the_place_of_the_older(
    narrow: NarrowTransport, sender: Sender, patient: None
) -> None:
    for frame in (QUICK_STOP, OTHER_AXIS, *[QUICK_STOP] * 100, DISABLE_VOLTAGE):
        assert not sender.send_urgent(REQUEST, frame)
    sender.send_urgent(0x603, QUICK_STOP)
    narrow.open()
    until(lambda: len(narrow.sent) == 3)
    assert narrow.sent == [(REQUEST, DISABLE_VOLTAGE), (REQUEST, OTHER_AXIS), (0x603, QUICK_STOP)]


def test_urgent_frames_do_not_pile_up(narrow: NarrowTransport, sender: Sender, patient: None) -> None:
    frames = [(0x601 + number, QUICK_STOP) for number in range(senders.MAX_URGENT + 1)]
    for frame in frames:
        sender.send_urgent(*frame)
    narrow.open()
    until(lambda: len(narrow.sent) == senders.MAX_URGENT)
    assert narrow.sent == frames[1:]


def test_an_urgent_frame_that_is_too_late_is_not_sent(
    narrow: NarrowTransport, sender: Sender, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(senders, "URGENT_S", 0.0)
    sender.send_urgent(REQUEST, QUICK_STOP)
    until(lambda: not sender._urgent)
    narrow.open()
    sender.send(0x601, b"")
    assert narrow.sent == [(0x601, b"")]


def test_what_was_overtaken_while_it_waited_is_not_sent(
    narrow: NarrowTransport, sender: Sender, later: Callable[..., Future[bool]], patient: None
) -> None:
    wanted = True
    enabling = later(REQUEST, b"enable operation", lambda: wanted)
    wanted = False
    sender.send_urgent(REQUEST, QUICK_STOP)
    narrow.open()
    assert enabling.result(WAIT_S) is False
    assert sender.offer(REQUEST, b"enable operation", lambda: wanted)() is False
    assert narrow.sent == [(REQUEST, QUICK_STOP)]


def test_a_request_that_waits_urgently_is_not_sent_twice(
    narrow: NarrowTransport, sender: Sender, patient: None
) -> None:
    sender.send_urgent(REQUEST, QUICK_STOP)
    urgent = next(iter(sender._urgent.values()))
    with ThreadPoolExecutor(1) as threads:
        asked = threads.submit(sender.send, REQUEST, QUICK_STOP)
        until(lambda: urgent.settled or sender._normal)
        narrow.open()
        asked.result(WAIT_S)
        sender.send(REQUEST, b"next")
    assert narrow.sent == [(REQUEST, QUICK_STOP), (REQUEST, b"next")]


def test_who_waits_when_the_bus_closes_is_told(
    sender: Sender, later: Callable[..., Future[bool]], patient: None
) -> None:
    waiting = later(0x601, b"")
    sender.stop()
    with pytest.raises(Unavailable, match="bus main is not open"):
        waiting.result(WAIT_S)
    with pytest.raises(Unavailable, match="bus main is not open"):
        sender.send(0x601, b"")
    assert not sender.send_urgent(0x601, b"")


@pytest.mark.parametrize("blocks", [True, False])
def test_whatever_goes_wrong_in_sending_is_told_and_ends_no_thread(blocks: bool, patient: None) -> None:
    narrow = NarrowTransport(blocks=blocks)
    with sending(narrow) as sender:
        narrow.fails = ZeroDivisionError("oops")
        with pytest.raises(Unavailable, match="internal error in sending: ZeroDivisionError: oops"):
            sender.send(0x601, b"")
        assert not sender.send_urgent(0x601, b"")
        until(lambda: not sender._urgent)
        narrow.fails = None
        narrow.open()
        sender.send(0x602, b"")
        until(lambda: (0x602, b"") in narrow.sent)


class TestInterfaceThatBlocks:
    """Such as one on a serial line: only the bus's own thread waits for it."""

    def test_urgent_frames_do_not_wait_for_it(self, patient: None) -> None:
        narrow = NarrowTransport(blocks=True)
        with sending(narrow) as sender, ThreadPoolExecutor(1) as threads:
            normal = threads.submit(sender.send, REQUEST, b"normal")
            until(lambda: narrow.asked)
            assert not sender.send_urgent(REQUEST, QUICK_STOP)
            narrow.open()
            normal.result(WAIT_S)
            until(lambda: len(narrow.sent) == 2)
            assert set(narrow.threads) == {"main out"}

    def test_a_frame_on_its_way_may_still_leave_and_that_is_said(self) -> None:
        narrow = NarrowTransport(blocks=True)
        with sending(narrow) as sender:
            with pytest.raises(Unavailable, match=r"acknowledge\? It may still leave"):
                offered(sender, 0x601, b"", lambda: narrow.asked)()
            with pytest.raises(Unavailable, match=r"acknowledge\?$"):
                sender.send(0x602, b"")
            narrow.open()
            sender.send(0x603, b"")
            assert narrow.sent == [(0x601, b""), (0x603, b"")]


@contextmanager
def open_bus(
    name: str, transports: dict[str, NarrowTransport], monkeypatch: pytest.MonkeyPatch
) -> Iterator[CanBus]:
    monkeypatch.setattr("drivers.bus.bus.open_transport", lambda settings: transports[settings.channel])
    bus = CanBus(name, CanSettings(interface="narrow", channel=name))
    bus.start()
    try:
        until(lambda: bus.opened)
        yield bus
    finally:
        bus.stop()


def test_a_bus_that_takes_nothing_delays_no_stop_on_another(
    monkeypatch: pytest.MonkeyPatch, patient: None
) -> None:
    """Neither the stops nor the threads of the healthy bus wait for any time-out: it would never end."""
    transports = {"dead": NarrowTransport(), "healthy": NarrowTransport(room=1000)}
    with (
        open_bus("dead", transports, monkeypatch) as dead,
        open_bus("healthy", transports, monkeypatch) as healthy,
    ):
        heard: list[bytes] = []
        healthy.subscribe(0x582, lambda _stamp_ns, data: heard.append(data))
        stops = [(0x600 + node_id, QUICK_STOP) for node_id in range(1, 9)]
        for stop in stops:
            assert not dead.send_urgent(*stop)
            assert healthy.send_urgent(*stop)
        assert transports["healthy"].sent == stops  # when the call returned
        assert set(transports["healthy"].threads) == {ME}
        transports["healthy"].incoming.put((0, 0x582, b"answer"))
        until(lambda: heard)
        assert transports["dead"].sent == []
        transports["dead"].open()
        until(lambda: transports["dead"].sent == stops)


def test_a_bus_that_takes_nothing_is_closed_at_once(monkeypatch: pytest.MonkeyPatch, patient: None) -> None:
    with open_bus("dead", {"dead": NarrowTransport()}, monkeypatch) as dead:
        dead.send_urgent(REQUEST, QUICK_STOP)
    with pytest.raises(Unavailable, match="bus dead is not open: it was closed"):
        dead.send(REQUEST, QUICK_STOP)
