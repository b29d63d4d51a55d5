"""Streams: ticks hold the newest fresh sample, own samples are complete, slow clients lose the oldest."""

import itertools
import json
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, cast

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.component import ComponentKind
from gateway.connections.session import Session
from gateway.modules.component.module import ComponentSource
from gateway.process.loop import Loop
from gateway.streaming import feeds
from gateway.streaming.budget import Budget
from gateway.streaming.feeds import Feed, SampleFeed, TickFeed, values_a_second
from gateway.streaming.outlets import Batch, Outlet, encode_batch
from gateway.streaming.sources import merge, narrow, whole
from gateway.streaming.streams import Streams
from gateway.wire import limits
from gateway.wire.framing import RpcError
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench, Client, FakeComponent

MS = 1_000_000


class FakeSession:
    """A session whose client takes nothing until it is asked."""

    def __init__(self) -> None:
        self.pumped = 0
        self.cpu_ns = 0
        self.closed = False
        self.outlets: dict[int, Outlet] = {}
        self.on_close = lambda farewell, whose=None: None

    def pump(self) -> None:
        self.pumped += 1


def outlet(most_bytes: int = 1 << 20) -> Outlet:
    session: Any = FakeSession()
    feed: Any = None
    return Outlet(1, session, feed, most_bytes)


def taken(one: Outlet) -> list[dict[str, Any]]:
    return [json.loads(line)["params"] for line in iter(one.next_line, None)]


def knee(stale_after_s: float = 1000.0) -> FakeComponent:
    return FakeComponent("knee", ComponentKind.JOINT, ["position", "torque"], stale_after_s)


def rows(data: list[dict[str, Any]]) -> list[tuple[int, dict[str, float | None]]]:
    return [
        (stamp_ns, {name: column[i] for name, column in one["columns"].items()})
        for one in data
        for i, stamp_ns in enumerate(one["stamp_ns"])
    ]


def tick_feed(component: FakeComponent, rate_hz: float) -> tuple[TickFeed, Outlet, int]:
    """A feed that nobody's loop runs: tests turn it by hand. Its first tick is at the time returned."""
    feed = TickFeed(Loop(), [whole(ComponentSource(component))], rate_hz)
    one = outlet()
    feed.outlets.append(one)
    return feed, one, feed._next_ns


def finish(feed: Feed) -> None:
    feed.close()
    feed._loop.close()


def turn_until(feed: TickFeed, tick_ns: int) -> None:
    while feed._next_ns <= tick_ns:
        until(lambda: time.monotonic_ns() >= tick_ns, "time passes")
        feed._tick()


def test_each_cell_is_the_newest_sample_at_its_tick_however_late_the_loop_is() -> None:
    component = knee()
    feed, one, first_ns = tick_feed(component, 100)
    component.give(1.0, 10.0, stamp_ns=first_ns - 1)
    component.give(2.0, 20.0, stamp_ns=first_ns + 15 * MS)
    component.latest.update(first_ns + 25 * MS, (1,), (30.0,))
    component.give(9.0, 90.0, stamp_ns=first_ns + 10_000 * MS)
    turn_until(feed, first_ns + 30 * MS)
    found = rows(taken(one))[:4]
    assert [stamp_ns - first_ns for stamp_ns, _ in found] == [0, 10 * MS, 20 * MS, 30 * MS]
    assert [(row["knee.position"], row["knee.torque"]) for _, row in found] == [
        (1.0, 10.0),
        (1.0, 10.0),
        (2.0, 20.0),
        (2.0, 30.0),
    ]
    finish(feed)


def test_a_cell_is_null_before_its_first_sample_and_once_stale() -> None:
    component = knee(stale_after_s=0.02)
    feed, one, first_ns = tick_feed(component, 100)
    component.give(1.0, None, stamp_ns=first_ns + 5 * MS)
    turn_until(feed, first_ns + 40 * MS)
    positions = [row["knee.position"] for _, row in rows(taken(one))[:5]]
    assert positions == [None, 1.0, 1.0, None, None]
    finish(feed)


def test_what_a_source_has_cleared_is_null_at_once() -> None:
    component = knee()
    component.give(1.0, 2.0)
    feed, one, first_ns = tick_feed(component, 100)
    turn_until(feed, first_ns)
    component.latest.clear()
    turn_until(feed, feed._next_ns + 10 * MS)  # however late the first ones were
    found = [row["knee.position"] for _, row in rows(taken(one))]
    assert found[0] == 1.0
    assert found[-1] is None
    finish(feed)


def test_fast_ticks_travel_together_and_slow_ones_alone() -> None:
    for rate_hz, most in ((1000, 10), (100, 1)):
        feed, _, _ = tick_feed(knee(), rate_hz)
        assert feed._ticks_per_batch == most
        finish(feed)


def test_ticks_that_the_loop_missed_for_too_long_are_counted_as_dropped() -> None:
    feed, one, first_ns = tick_feed(knee(), 100)
    feed._next_ns = first_ns - 5_000 * MS
    feed._tick()
    data = taken(one)
    kept = len(rows(data))
    assert kept <= 102
    assert data[0]["dropped"] >= 398
    finish(feed)


def test_own_samples_come_complete_one_component_a_notification() -> None:
    component, other = knee(), FakeComponent("trunk", ComponentKind.IMU, ["tilt_forward"])
    loop = Loop()
    feed = SampleFeed(loop, [whole(ComponentSource(component)), whole(ComponentSource(other))])
    one = outlet()
    feed.outlets.append(one)
    component.give(1.0, 10.0, stamp_ns=1)
    component.give(2.0, 20.0, stamp_ns=2)
    component.latest.update(3, (1,), (30.0,))
    other.give(0.1, stamp_ns=4)
    feed._flush()
    found = [(data["stamp_ns"], data["columns"]) for data in taken(one)]
    assert found == [
        ([1, 2], {"knee.position": [1.0, 2.0], "knee.torque": [10.0, 20.0]}),
        ([3], {"knee.torque": [30.0]}),
        ([4], {"trunk.tilt_forward": [0.1]}),
    ]
    finish(feed)


def test_own_samples_show_only_the_channels_asked_for() -> None:
    component = knee()
    feed = SampleFeed(Loop(), narrow([whole(ComponentSource(component))], ["*.position"]))
    one = outlet()
    feed.outlets.append(one)
    component.give(1.0, 10.0, stamp_ns=1)
    component.latest.update(2, (1,), (30.0,))
    feed._flush()
    assert [data["columns"] for data in taken(one)] == [{"knee.position": [1.0]}]
    finish(feed)


def test_a_source_that_outruns_the_loop_loses_and_it_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(feeds, "TAP_SAMPLES", 3)
    component = knee()
    feed = SampleFeed(Loop(), [whole(ComponentSource(component))])
    one = outlet()
    feed.outlets.append(one)
    for stamp_ns in range(5):
        component.give(1.0, 2.0, stamp_ns=stamp_ns)
    feed._flush()
    data = taken(one)
    assert [stamp_ns for stamp_ns, _ in rows(data)] == [0, 1, 2]
    assert data[0]["dropped"] == 2
    finish(feed)


def test_a_slow_client_loses_the_oldest_rows_and_is_told() -> None:
    batches = [encode_batch([n, n + 1], {"knee.position": [float(n), None]}) for n in range(100, 120, 2)]
    one = outlet(3 * batches[0].size)
    for batch in batches:
        one.offer(batch)
    data = taken(one)
    assert [stamp_ns for stamp_ns, _ in rows(data)] == [114, 115, 116, 117, 118, 119]
    assert [(each["seq"], each["dropped"]) for each in data] == [(0, 14), (1, 14), (2, 14)]


def test_all_streams_of_a_client_have_one_buffer_together() -> None:
    batch = encode_batch([1], {"knee.position": [1.0]})
    loop, session = Loop(), cast("Session", FakeSession())
    started = Streams(loop, 12 * batch.size, Budget(loop, None))
    numbers = [started.start(session, [whole(ComponentSource(knee()))], rate_hz) for rate_hz in (10, 20, 30)]
    for _ in range(20):
        for outlet in started.of(session):
            outlet.offer(batch)
    assert [outlet.waiting_bytes for outlet in started.of(session)] == [4 * batch.size] * 3
    started.stop(session, numbers[0])
    assert [outlet.most_bytes for outlet in started.of(session)] == [6 * batch.size] * 2
    for number in numbers[1:]:
        started.stop(session, number)
    assert loop._patience_s() is None
    loop.close()


@given(st.lists(st.one_of(st.integers(1, 5), st.none()), max_size=60))
def test_rows_sent_and_rows_dropped_are_all_rows(steps: list[int | None]) -> None:
    """Batches of that many rows are offered; `None` is a client that takes one line."""
    one = outlet()
    offered = received = dropped = 0
    seqs: list[int] = []
    limit = one.most_bytes
    for step in [*steps, *[None] * 60]:
        if step is None:
            line = one.next_line()
            if line is not None:
                data = json.loads(line)["params"]
                received += len(data["stamp_ns"])
                assert data["dropped"] >= dropped
                dropped = data["dropped"]
                seqs.append(data["seq"])
        else:
            batch = encode_batch([0] * step, {})
            one.offer(Batch(batch.rows, batch.stamps, batch.columns, size=limit // 3))
            offered += step
    assert seqs == list(range(len(seqs)))
    assert received + one.dropped == offered


def test_selections_are_merged_channel_by_channel() -> None:
    source = ComponentSource(knee())
    merged = merge([*narrow([whole(source)], ["*.torque"]), *narrow([whole(source)], ["*.position"])])
    assert [one.names for one in merged] == [("knee.position", "knee.torque")]


class TestCost:
    """A robot is asked for no more than it can give; who asks for little is always served."""

    @pytest.fixture
    def started(self) -> Iterator[Streams]:
        loop = Loop()
        yield Streams(loop, 1 << 16, Budget(loop, None))
        loop.close()

    def fill(self, started: Streams, rates_hz: Iterable[float]) -> "Session":
        session = cast("Session", FakeSession())
        for rate_hz in rates_hz:
            started.start(session, [whole(ComponentSource(knee()))], rate_hz)
        return session

    def end(self, started: Streams, *sessions: "Session") -> None:
        for session in sessions:
            for number in tuple(session.outlets):
                started.stop(session, number)

    def test_one_clients_streams_have_a_limit(self, started: Streams) -> None:
        most = int(limits.VALUES_A_SECOND / values_a_second(1000, 2))
        session = self.fill(started, [1000 - number / 10 for number in range(most)])
        with pytest.raises(RpcError, match=r"your streams would cost 9\d\d,\d\d\d values a second"):
            started.start(session, [whole(ComponentSource(knee()))], 0.0)
        self.end(started, session)

    def test_so_have_all_clients_that_ask_for_different_ones(self, started: Streams) -> None:
        each = [1000 - number / 10 for number in range(12)]
        sessions = [self.fill(started, [rate - own / 1000 for rate in each]) for own in range(3)]
        late = cast("Session", FakeSession())
        for rate_hz in (900.0, 901.0, 902.0, 903.0, 904.0, 905.0, 906.0, 907.0):
            started.start(late, [whole(ComponentSource(knee()))], rate_hz)
        with pytest.raises(RpcError, match=r"the streams of all clients would cost 2,7\d\d,\d\d\d"):
            started.start(late, [whole(ComponentSource(knee()))], 908.0)
        started.start(late, [whole(ComponentSource(knee()))], 1000.0)  # one that there is costs nothing more
        modest = self.fill(started, [100.0, 200.0])
        self.end(started, late, modest, *sessions)


def test_a_feed_that_is_late_catches_up_in_several_turns_and_loses_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(feeds, "TURN_VALUES", 30)
    component = knee()
    feed, one, began_ns = tick_feed(component, 1000)
    for at in range(50):
        component.give(float(at), 0.0, stamp_ns=began_ns + at * MS)
    until(lambda: time.monotonic_ns() >= began_ns + 60 * MS, "time passes")
    feed._tick()
    first = rows(taken(one))
    assert len(first) <= 12
    turn_until(feed, began_ns + 50 * MS)
    found = first + rows(taken(one))
    assert [row["knee.position"] for _, row in found[:50]] == [float(at) for at in range(50)]
    assert one.dropped == 0
    finish(feed)


# Over the wire


def test_a_stream_numbers_its_notifications_and_loses_nothing(client: Client) -> None:
    start = {"modules": ["component"], "rate_hz": 200, "channels": ["*.position"]}
    number = client.call("stream.start", **start)["stream"]
    data = [client.data() for _ in range(40)]
    assert {one["stream"] for one in data} == {number}
    assert [one["seq"] for one in data] == list(range(40))
    assert {one["dropped"] for one in data} == {0}
    stamps = [stamp_ns for stamp_ns, _ in rows(data)]
    assert {b - a for a, b in itertools.pairwise(stamps)} == {5 * MS}
    assert all(row == {"left_knee.position": 0.5, "right_knee.position": 0.5} for _, row in rows(data))


def test_the_answer_comes_before_the_first_notification(client: Client) -> None:
    for _ in range(20):
        id_ = client.request("stream.start", modules=["component"], rate_hz=1000)
        while True:
            message = client.line()
            assert message is not None
            if message.get("id") == id_:
                break
            assert message["params"]["stream"] < id_ + 1
        client.call("stream.stop", stream=message["result"]["stream"])


def test_own_samples_over_the_wire(client: Client, bench: Bench) -> None:
    client.call("stream.start", modules=["component"], rate_hz=0)
    bench.insole.give(123.0, 0.1, stamp_ns=77)
    data = client.data()
    assert data["stamp_ns"] == [77]
    assert data["columns"] == {"left_insole.force": [123.0], "left_insole.cop_x": [0.1]}


def test_a_stopped_stream_is_silent_and_unknown(client: Client, bench: Bench) -> None:
    number = client.call("stream.start", modules=["component"], rate_hz=0)["stream"]
    assert client.call("stream.stop", stream=number) == {}
    bench.insole.give(1.0, 2.0)
    assert client.refused("stream.stop", stream=number).kind == "unknown_name"
    assert not client.notifications


def test_nobody_stops_another_connections_stream(connect: Callable[[], Client]) -> None:
    first, second = connect(), connect()
    number = first.call("stream.start", modules=["component"], rate_hz=10)["stream"]
    assert second.refused("stream.stop", stream=number).kind == "unknown_name"
    assert first.data()["stream"] == number


def test_resource_columns_stream_without_the_process_table(client: Client) -> None:
    client.call("stream.start", modules=["resource"], rate_hz=50)
    until(lambda: client.data()["columns"]["resource.memory_percent"][0] is not None, "memory is measured")
    assert all(name.startswith("resource.") for name in client.data()["columns"])


def test_status_and_component_in_one_stream_have_each_channel_once(client: Client) -> None:
    client.call("stream.start", modules=["status", "component"], rate_hz=50)
    names = list(client.data()["columns"])
    assert len(names) == len(set(names))
    assert {"left_knee.position", "left_knee.statusword", "resource.cpu_percent"} <= set(names)


def test_one_stream_too_many_is_refused(client: Client) -> None:
    for _ in range(limits.STREAMS):
        client.call("stream.start", modules=["component"], rate_hz=1)
    assert client.refused("stream.start", modules=["component"], rate_hz=1).kind == "unavailable"


def test_a_stream_of_nothing_is_refused(client: Client) -> None:
    start = {"modules": ["component"], "rate_hz": 5}
    assert client.refused("stream.start", **start, channels=["nothing.*"]).kind == "unknown_name"
    for rate_hz in (-1, 1001):
        assert client.refused("stream.start", modules=["component"], rate_hz=rate_hz).kind == "bad_params"


def test_clients_that_ask_for_the_same_share_one_feed(connect: Callable[[], Client], bench: Bench) -> None:
    clients = [connect() for _ in range(5)]
    for one in clients:
        one.call("stream.start", modules=["component"], rate_hz=50)
    assert all(one.data()["columns"]["left_knee.position"] for one in clients)
    assert len(bench.left.latest._listeners) == 1
    for one in clients:
        one.close()
    until(lambda: not bench.left.latest._listeners, "the feed has ended with its last client")


def test_the_loop_has_no_timer_and_nothing_to_do_when_idle() -> None:
    loop = Loop()
    assert loop._patience_s() is None
    timer = loop.call_later(100.0, lambda: None)
    assert (loop._patience_s() or 0) > 50
    timer.cancel()
    assert loop._patience_s() is None
    assert len(loop._watched) == 1
    loop.close()


def test_a_batch_that_is_larger_than_the_buffer_is_sent_all_the_same() -> None:
    small = outlet(most_bytes=1)
    for value in (1.0, 2.0):
        small.offer(encode_batch([int(value)], {"knee.position": [value]}))
    assert [(one["columns"], one["dropped"]) for one in taken(small)] == [({"knee.position": [2.0]}, 1)]
