"""A channel that knows whether it is in sync: what it says was read or taken, was so after it was asked."""

import contextlib
import itertools
import queue
import struct
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.bus.sdo import protocol
from drivers.bus.sdo.answers import INBOX, Answers, SdoCounters
from drivers.bus.sdo.channel import OUT_OF_SYNC, SdoChannel
from drivers.bus.sdo.outstanding import Outstanding
from drivers.bus.sdo.round_trips import RoundTrips
from drivers.errors import DeviceAbort, DeviceTimeout, DriverError, Unavailable
from tests.support.examples import examples
from tests.unit.bus.direct import Direct
from tests.unit.bus.late_server import ABSENT, AT_ONCE, CLOCK, LONG, VALUE, Fate, LateServer

LOST, UNHEARD = Fate(answered=False), Fate(taken=False)
OLD, NEW = bytes(4), b"\1\2\3\4"


def number(data: bytes) -> int:
    return int.from_bytes(data, "little")


# Whatever is late or lost.

fates = st.builds(
    Fate,
    taken=st.integers(0, 5).map(bool),
    answered=st.integers(0, 5).map(bool),
    lag=st.sampled_from((0, 0, 0, 0, 1, 2, 3, 7)),
    copies=st.sampled_from((1, 1, 1, 2)),
)

steps = st.lists(st.sampled_from(("clock", "long", "write", "value", "absent")), min_size=1, max_size=12)


class Reader:
    """Asks one server, and fails where an answer is not of the time."""

    def __init__(self, server: LateServer) -> None:
        self.server = server
        self.channel = server.channel
        self.written = itertools.count(1)
        self.do: dict[str, Callable[[], None]] = {
            "clock": self.clock,
            "long": self.long,
            "write": self.write,
            "value": self.value,
            "absent": self.absent,
        }

    def clock(self) -> None:
        before = self.server.sent
        assert number(self.channel.upload(CLOCK, 0)) > before

    def long(self) -> None:
        before = self.server.sent
        first, *others = struct.unpack("<III", self.channel.upload(LONG, 0))
        assert first > before
        assert others == [first, first]

    def write(self) -> None:
        before, data = self.server.sent, next(self.written).to_bytes(4, "little")
        self.channel.download(VALUE, 0, data)
        assert (self.server.value, self.server.taken_at > before) == (data, True)

    def value(self) -> None:
        assert self.channel.upload(VALUE, 0) == self.server.value

    def absent(self) -> None:
        with pytest.raises(DeviceAbort):
            self.channel.upload(ABSENT, 0)

    def step(self, name: str) -> None:
        try:
            self.do[name]()
        except DeviceTimeout:
            return
        finally:
            known = self.channel.known(VALUE, 0)
            assert known in (None, self.server.value)


@settings(max_examples=examples(150))
@given(st.lists(fates, max_size=40), steps)
def test_nothing_is_believed_that_is_older_than_its_question(drawn: list[Fate], names: list[str]) -> None:
    server = LateServer(iter(drawn))
    reader = Reader(server)
    for name in names:
        reader.step(name)


@settings(max_examples=examples(50))
@given(st.lists(fates, max_size=40), steps)
def test_once_its_answers_come_again_everything_can_be_asked(drawn: list[Fate], names: list[str]) -> None:
    server = LateServer(iter(drawn))
    reader = Reader(server)
    for name in names:
        reader.step(name)
    server.fates = itertools.repeat(AT_ONCE)
    for name in reader.do:
        for _ in range(8):  # what was late is in front of what is not
            reader.step(name)
        reader.do[name]()


@pytest.mark.parametrize("read_late", range(1, 7))
@pytest.mark.parametrize("write_late", range(4))
def test_a_late_answer_to_an_earlier_read_is_not_taken_for_what_the_device_holds_now(
    read_late: int, write_late: int
) -> None:
    """A write stays unanswered; whether the device took it, no read from before the write may tell."""
    server = LateServer(itertools.chain([Fate(lag=read_late)], itertools.repeat(Fate(lag=write_late))))
    with contextlib.suppress(DeviceTimeout):
        server.channel.upload(VALUE, 0)
    with contextlib.suppress(DeviceTimeout):
        server.channel.download(VALUE, 0, NEW)
    for _ in range(5):
        with contextlib.suppress(DeviceTimeout):
            assert server.channel.upload(VALUE, 0) == server.value


def test_a_late_answer_to_this_very_read_is_believed() -> None:
    server = LateServer(iter([Fate(lag=1)]))
    assert number(server.channel.upload(CLOCK, 0)) == 1
    assert server.asked() == [CLOCK, 0x1000]
    assert server.channel.counters.timeouts == 1


# How it is brought in sync.


def test_in_sync_nothing_else_is_asked() -> None:
    server = LateServer()
    for _ in range(3):
        server.channel.upload(CLOCK, 0)
        server.channel.download(VALUE, 0, NEW)
        server.channel.upload(LONG, 0)
    assert set(server.asked()) == {CLOCK, VALUE, LONG, 0}  # 0: the segments of LONG
    assert server.channel.counters.resyncs == 0


def test_another_object_is_read_before_the_one_that_was_not_answered() -> None:
    server = LateServer(iter([LOST, AT_ONCE]))
    server.channel.upload(CLOCK, 0)
    assert server.asked() == [CLOCK, 0x1000, CLOCK]
    server.channel.upload(CLOCK, 0)
    assert server.asked() == [CLOCK, 0x1000, CLOCK, CLOCK]


def test_an_object_is_not_brought_in_sync_by_itself() -> None:
    server = LateServer(iter([LOST, AT_ONCE]))
    server.channel.upload(0x1000, 0)
    assert server.asked() == [0x1000, 0x1018, 0x1000]


def test_an_answer_to_anything_that_was_asked_later_is_enough() -> None:
    server = LateServer(iter([LOST]))
    with pytest.raises(DeviceTimeout):
        server.channel.upload(CLOCK, 0, attempts=1)
    server.channel.upload(VALUE, 0)
    server.channel.upload(CLOCK, 0)
    assert server.asked() == [CLOCK, VALUE, CLOCK]


def test_a_refusal_of_the_other_object_is_an_answer_too() -> None:
    server = LateServer(iter([LOST]))

    def refuse(request: bytes) -> None:
        if request[2] == 0x10:  # 1000h …
            server.channel.on_response(0, b"\x80" + request[1:4] + bytes(4))

    server.on_request = refuse
    assert number(server.channel.upload(CLOCK, 0)) == 3


def test_a_device_that_answers_it_in_segments_is_told_that_they_are_not_wanted() -> None:
    server = LateServer(iter([LOST]))
    ended: list[bytes] = []
    hear = server.hear

    def segmented(request: bytes) -> None:
        if request[0] == 0x80:
            ended.append(request[1:4])
        if request[:3] == b"\x40\x00\x10":
            server.channel.on_response(0, b"\x41" + request[1:4] + (4).to_bytes(4, "little"))
        else:
            hear(request)

    server.channel._outlet = Direct(segmented)
    server.channel.upload(CLOCK, 0)
    assert ended == [b"\x00\x20\x00", b"\x00\x10\x00"]


def test_where_nothing_tells_which_answer_is_which_it_is_said_and_the_object_not_asked() -> None:
    server = LateServer(itertools.repeat(LOST))
    with pytest.raises(DeviceTimeout, match="reading 0x2000:00: no answer"):
        server.channel.upload(CLOCK, 0, attempts=1)
    with pytest.raises(DeviceTimeout, match="0x2000:00: not asked, because an answer could be a late one"):
        server.channel.upload(CLOCK, 0)
    assert server.asked().count(CLOCK) == 1


def test_a_write_waits_for_sync_and_is_not_called_unknown_where_it_was_not_sent() -> None:
    server = LateServer(iter([LOST, LOST, AT_ONCE]))
    with pytest.raises(DeviceTimeout, match="not known"):
        server.channel.download(VALUE, 0, OLD)
    with pytest.raises(DeviceTimeout, match="not asked") as caught:
        server.channel.download(VALUE, 0, NEW)
    assert "not known" not in str(caught.value)
    assert server.value == OLD
    server.channel.download(VALUE, 0, NEW)
    assert server.value == NEW


def test_a_write_of_an_urgent_job_waits_for_nothing_and_the_read_after_it_is_in_sync() -> None:
    server = LateServer(iter([LOST, LOST]))
    server.channel.resume(urgent=True)
    for _ in range(2):
        with pytest.raises(DeviceTimeout):
            server.channel.download(VALUE, 0, NEW)
    server.channel.download(VALUE, 0, NEW)
    assert server.asked() == [VALUE, VALUE, VALUE]
    assert server.channel.upload(VALUE, 0) == NEW
    assert server.asked()[3] != VALUE


def test_a_late_confirmation_of_another_value_does_not_confirm_an_urgent_write() -> None:
    server = LateServer(iter([Fate(lag=1), LOST]))
    server.channel.resume(urgent=True)
    with pytest.raises(DeviceTimeout):
        server.channel.download(VALUE, 0, OLD)
    with pytest.raises(DeviceTimeout):
        server.channel.download(VALUE, 0, NEW)


def test_a_late_confirmation_of_the_same_value_does() -> None:
    server = LateServer(iter([Fate(lag=1), LOST]))
    server.channel.resume(urgent=True)
    with pytest.raises(DeviceTimeout):
        server.channel.download(VALUE, 0, NEW)
    server.channel.download(VALUE, 0, NEW)


def test_an_abort_without_an_object_ends_what_is_alone_in_flight() -> None:
    server = LateServer()
    server.on_request = lambda request: server.channel.on_response(0, b"\x80" + bytes(7))
    with pytest.raises(DeviceAbort):
        server.channel.upload(CLOCK, 0)


def test_an_abort_without_an_object_that_may_be_a_late_one_ends_nothing() -> None:
    server = LateServer(iter([AT_ONCE, AT_ONCE, LOST]))
    with pytest.raises(DeviceTimeout):
        server.channel.upload(LONG, 0, attempts=1)  # its second segment is lost
    server.on_request = lambda request: server.channel.on_response(0, b"\x80" + bytes(7))
    assert number(server.channel.upload(CLOCK, 0)) == 4


# A node that is silent for long.


def asked_until_read(server: LateServer, index: int) -> int:
    before = server.sent
    for _ in range(5):
        try:
            server.channel.upload(index, 0, attempts=1)
        except DeviceTimeout:
            continue
        return server.sent - before
    raise AssertionError("it is not in sync again")


def test_a_node_that_was_silent_for_hours_is_in_sync_after_a_few_round_trips() -> None:
    """While it is silent the hold of a stop asks it again and again, and so do its polls."""
    server = LateServer(itertools.repeat(UNHEARD), timeout_s=0.00001)
    for _ in range(300):
        server.channel.resume(urgent=True)
        with pytest.raises(DeviceTimeout):
            server.channel.download(VALUE, 0, NEW)
        server.channel.resume()
        for index in (CLOCK, 0x1000):
            with pytest.raises(DeviceTimeout):
                server.channel.upload(index, 0)
    server.fates = itertools.repeat(AT_ONCE)
    server.channel.timeout_s = 0.05
    server.channel.resume()
    assert asked_until_read(server, 0x1000) <= 3
    assert asked_until_read(server, CLOCK) == 1


def test_answers_of_hours_that_come_at_once_are_not_believed() -> None:
    server = LateServer(itertools.repeat(Fate(lag=10_000)), timeout_s=0.00001)
    for _ in range(1000):
        with pytest.raises(DeviceTimeout):
            server.channel.upload(CLOCK, 0, attempts=1)
    server.sent = 20_000
    server.fates = itertools.repeat(AT_ONCE)
    server.channel.timeout_s = 0.05
    for _ in range(5):
        server.deliver()
        try:
            assert number(server.channel.upload(CLOCK, 0, attempts=1)) > 20_000
        except DeviceTimeout:
            continue
    assert number(server.channel.upload(CLOCK, 0)) > 20_000


def test_a_booted_node_has_forgotten_what_it_was_asked() -> None:
    server = LateServer(iter([LOST, LOST]))
    for index in (CLOCK, VALUE):
        with pytest.raises(DeviceTimeout):
            server.channel.upload(index, 0, attempts=1)
    server.channel.rebooted()
    server.channel.upload(CLOCK, 0)
    assert server.asked() == [CLOCK, VALUE, CLOCK]


def test_a_node_that_never_answers_to_what_it_was_asked_is_out_of_sync() -> None:
    server = LateServer(itertools.repeat(LOST))
    server.on_request = lambda request: server.channel.on_response(0, b"\x43\x41\x60\0" + bytes(4))  # 6041h
    for _ in range(OUT_OF_SYNC + 1):
        assert not server.channel.out_of_sync
        with pytest.raises(DeviceTimeout):
            server.channel.upload(CLOCK, 0, attempts=1)
    assert server.channel.out_of_sync
    server.fates = itertools.repeat(AT_ONCE)
    server.channel.upload(VALUE, 0)
    assert not server.channel.out_of_sync


def test_a_silent_node_is_not_called_out_of_sync() -> None:
    server = LateServer(itertools.repeat(LOST))
    for _ in range(3 * OUT_OF_SYNC):
        with pytest.raises(DeviceTimeout):
            server.channel.upload(CLOCK, 0, attempts=1)
    assert not server.channel.out_of_sync


# What is counted, and what is known.


def test_responses_that_nobody_fetches_are_bounded_and_counted() -> None:
    server = LateServer()
    for _ in range(INBOX + 100):
        server.channel.on_response(0, b"\x43\x41\x60\0" + bytes(4))
    assert server.channel.counters.dropped == 100
    assert number(server.channel.upload(CLOCK, 0)) == 1
    assert server.channel.counters.stale == INBOX


def test_of_a_flood_that_nobody_fetches_the_first_are_kept() -> None:
    """The late answer to what was asked comes before what somebody else sends behind it."""
    counters = SdoCounters()
    outstanding = Outstanding()
    asked = outstanding.add(protocol.multiplexer(0x6041, 0), next(protocol.upload(0x6041, 0)))
    answers = Answers(outstanding, counters, RoundTrips(0.5))
    answers.put(0, b"\x4b\x41\x60\0" + bytes(4))
    for _ in range(10_000):
        answers.put(0, b"\x4b\x41\x60\0\1\0\0\0")
    answers.fetch_waiting()
    assert asked.answer == b"\x4b\x41\x60\0" + bytes(4)
    assert (counters.stale, counters.dropped) == (INBOX - 1, 10_001 - INBOX)


def test_waking_who_does_not_fetch_leaves_one_thing_to_fetch() -> None:
    answers = Answers(Outstanding(), SdoCounters(), RoundTrips(0.5))
    for _ in range(10_000):
        answers.wake()
    answers.fetch(deadline=0.0)
    with pytest.raises(queue.Empty):
        answers.fetch(deadline=0.0)


def test_second_answers_are_counted() -> None:
    server = LateServer(itertools.repeat(Fate(copies=2)))
    for _ in range(3):
        server.channel.upload(CLOCK, 0)
        server.channel.upload(VALUE, 0)
    assert server.channel.counters.doubled == 5  # the last is not fetched yet


def test_a_write_after_an_answer_that_came_twice_waits_until_it_is_seen_whether_all_do() -> None:
    """The first that two devices get must not be the one that shows that they are two."""
    server = LateServer(itertools.chain([Fate(copies=2)], itertools.repeat(AT_ONCE)))
    server.channel.upload(CLOCK, 0)
    server.channel.download(VALUE, 0, NEW)
    assert len(server.asked()) == 4, "once was by chance"
    server.channel.download(VALUE, 0, OLD)
    assert len(server.asked()) == 5
    seen: list[tuple[int, bool]] = []
    server.on_request = lambda request: seen.append((request[0], server.channel.doubled))
    server.fates = itertools.repeat(Fate(copies=2))
    server.channel.upload(CLOCK, 0)
    server.channel.download(VALUE, 0, NEW)
    assert [doubled for command, doubled in seen if command == 0x23] == [True]


def test_a_value_is_known_once_the_device_has_confirmed_it() -> None:
    server = LateServer()
    channel = server.channel
    assert (channel.known(VALUE, 0), channel.known(VALUE, 0, OLD)) == (None, OLD)
    during: list[tuple[bytes | None, bool]] = []
    server.on_request = lambda _: during.append((channel.known(VALUE, 0, OLD), channel.is_unsure(VALUE, 0)))
    channel.download(VALUE, 0, NEW)
    assert during == [(None, True)]
    assert (channel.known(VALUE, 0, OLD), channel.is_unsure(VALUE, 0)) == (NEW, False)


def refuse(channel: SdoChannel) -> Callable[[bytes], None]:
    return lambda request: channel.on_response(0, b"\x80" + request[1:4] + bytes(4))


def test_a_value_that_was_refused_changes_nothing_of_what_is_known() -> None:
    server = LateServer()
    server.channel.download(VALUE, 0, NEW)
    server.on_request = refuse(server.channel)
    with pytest.raises(DeviceAbort):
        server.channel.download(VALUE, 0, OLD)
    assert server.channel.known(VALUE, 0) == NEW


def test_a_write_without_an_answer_leaves_nothing_known() -> None:
    server = LateServer(iter([AT_ONCE, LOST]))
    server.channel.download(VALUE, 0, NEW)
    with pytest.raises(DeviceTimeout):
        server.channel.download(VALUE, 0, OLD)
    assert (server.channel.known(VALUE, 0, OLD), server.channel.is_unsure(VALUE, 0)) == (None, True)
    server.on_request = refuse(server.channel)
    with pytest.raises(DeviceAbort):
        server.channel.download(VALUE, 0, OLD)
    assert server.channel.is_unsure(VALUE, 0), "what was refused is not what was unknown"
    server.on_request = lambda request: None
    server.channel.download(VALUE, 0, OLD)
    assert server.channel.known(VALUE, 0) == OLD


def test_a_write_that_could_not_be_sent_changes_nothing_of_what_is_known() -> None:
    server = LateServer()
    server.channel.download(VALUE, 0, NEW)

    def gone(_request: bytes) -> None:
        raise Unavailable("bus main is not open")

    server.on_request = gone
    with pytest.raises(Unavailable):
        server.channel.download(VALUE, 0, OLD)
    assert server.channel.known(VALUE, 0) == NEW
    server.on_request = lambda request: None
    server.channel.upload(VALUE, 0)
    assert server.channel.counters.resyncs == 0, "what was not sent is not answered late"


def test_a_device_that_boots_during_a_write_is_not_said_to_hold_it() -> None:
    server = LateServer()
    server.on_request = lambda request: server.channel.rebooted()
    server.channel.download(VALUE, 0, NEW)
    assert (server.channel.known(VALUE, 0, OLD), server.channel.is_unsure(VALUE, 0)) == (None, True)


def test_after_the_device_has_booted_only_what_was_written_since_is_known() -> None:
    server = LateServer(iter([AT_ONCE, LOST]))
    server.channel.download(VALUE, 0, NEW)
    with pytest.raises(DeviceTimeout):
        server.channel.download(VALUE, 1, NEW)
    server.channel.forget_written()
    assert [server.channel.known(VALUE, at, OLD) for at in (0, 1)] == [OLD, OLD]


def test_a_write_without_an_answer_is_unknown_also_where_the_bus_has_gone_meanwhile() -> None:
    server = LateServer(itertools.repeat(LOST))
    sent: list[bytes] = []

    def hear(request: bytes) -> None:
        sent.append(request)
        if request[0] == 0x80:
            raise Unavailable("bus main is not open")

    server.channel._outlet = Direct(hear)
    with pytest.raises(DriverError, match="not known"):
        server.channel.download(VALUE, 0, NEW)
    assert [request[0] for request in sent] == [0x23, 0x80]
