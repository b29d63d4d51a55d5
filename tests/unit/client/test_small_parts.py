"""Back-off and clock offset: pure arithmetic."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.client.backoff import Backoff
from gateway.client.clock import ClockTracker


def test_waits_double_up_to_the_longest_and_begin_again_after_success() -> None:
    backoff = Backoff(first_s=0.1, longest_s=1.0, jitter=lambda: 0.0)
    assert [round(backoff.next_s(), 3) for _ in range(6)] == [0.1, 0.2, 0.4, 0.8, 1.0, 1.0]
    backoff.reset()
    assert backoff.next_s() == 0.1


def test_jitter_shortens_a_wait_by_at_most_half() -> None:
    assert Backoff(first_s=2.0, jitter=lambda: 1.0).next_s() == 1.0


def test_no_offset_before_the_first_exchange() -> None:
    assert ClockTracker().offset is None


def test_the_exchange_with_the_shortest_round_trip_counts() -> None:
    clock = ClockTracker()
    clock.feed(sent_ns=0, robot_ns=1_000_000, received_ns=400)
    clock.feed(sent_ns=1_000, robot_ns=1_001_010, received_ns=1_020)
    clock.feed(sent_ns=2_000, robot_ns=1_002_500, received_ns=3_000)
    assert clock.offset is not None
    assert clock.offset.offset_ns == 1_000_000
    assert clock.offset.uncertainty_ns == 10
    assert clock.round_trip_ns == 1_000


@given(
    true_ns=st.integers(-(10**15), 10**15),
    delays=st.lists(st.tuples(st.integers(0, 10**9), st.integers(0, 10**9)), min_size=1, max_size=20),
)
def test_true_offset_lies_within_the_stated_uncertainty(true_ns: int, delays: list[tuple[int, int]]) -> None:
    clock = ClockTracker()
    now_ns = 0
    for there_ns, back_ns in delays:
        clock.feed(now_ns, now_ns + there_ns + true_ns, now_ns + there_ns + back_ns)
        now_ns += 10**9
    offset = clock.offset
    assert offset is not None
    assert abs(offset.offset_ns - true_ns) <= offset.uncertainty_ns + 1
