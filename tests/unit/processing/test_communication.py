"""The quality of a link: figures over the last minute, health in words."""

import pytest

from gateway.client import Batch, ConnectionState
from server_gui.core.processing.communication import Health, LinkMonitor

SECOND = 1_000_000_000
PERIOD = SECOND // 50


def batch(number: int, late_ns: int = 0, **more: int) -> Batch:
    """The only row of notification `number`, which takes 5 ms and `late_ns` to come."""
    fields = {"seq": number, "dropped": 0, "missed": 0, "link": 1} | more
    stamp_ns = number * PERIOD
    return Batch([stamp_ns], {"a.b": [0.0]}, **fields, received_ns=stamp_ns + 5_000_000 + late_ns)


def connected() -> LinkMonitor:
    monitor = LinkMonitor()
    monitor.state(ConnectionState.CONNECTED, None, 0)
    return monitor


def streamed(monitor: LinkMonitor, seconds: int, age_ns: int = 5_000_000) -> int:
    for number in range(seconds * 50):
        monitor.take(1, batch(number), age_ns)
    return seconds * SECOND


def test_a_good_link() -> None:
    monitor = connected()
    monitor.round_trip(2_000_000)
    monitor.round_trip(None)
    quality = monitor.quality(streamed(monitor, 20))
    assert (quality.health, quality.reasons) == (Health.GOOD, ())
    assert quality.round_trip == pytest.approx(0.002)
    assert quality.rows_per_s == pytest.approx(50.0, rel=0.01)
    assert quality.jitter == 0.0
    assert quality.loss == 0.0
    assert quality.age == pytest.approx(0.005)


def test_rates_are_over_the_last_minute() -> None:
    monitor = connected()
    now_ns = streamed(monitor, 200)
    assert monitor.quality(now_ns).rows_per_s == pytest.approx(50.0, rel=0.02)


def test_a_link_that_is_down_says_why() -> None:
    monitor = connected()
    monitor.state(ConnectionState.WAITING, "192.0.2.7:7420 refuses", SECOND)
    quality = monitor.quality(2 * SECOND)
    assert (quality.health, quality.reasons) == (Health.DOWN, ("192.0.2.7:7420 refuses",))


def test_a_link_on_which_nothing_comes_is_poor() -> None:
    monitor = connected()
    now_ns = streamed(monitor, 2)
    assert monitor.quality(now_ns + 5 * SECOND).health is Health.POOR
    assert "no rows come" in monitor.quality(now_ns + 5 * SECOND).reasons[0]


def test_lost_rows_are_counted_wherever_they_were_lost() -> None:
    monitor = connected()
    for number in range(500):
        missed = 1 if number % 50 == 0 else 0
        monitor.take(1, batch(number, missed=missed, dropped=number // 100), 0)
    quality = monitor.quality(10 * SECOND)
    assert quality.loss == pytest.approx(14 / 514)
    assert quality.health is Health.POOR
    assert quality.reasons == ("2.7 % of the rows are lost: the network or this computer is too slow",)


def test_each_stream_counts_its_dropped_rows_by_itself_and_anew_on_a_new_link() -> None:
    monitor = connected()
    for number in range(100):
        monitor.take(1, batch(number, dropped=30), 0)
        monitor.take(2, batch(number, dropped=0), 0)
    monitor.take(1, batch(100, dropped=0, link=2), 0)
    assert monitor.quality(2 * SECOND).loss == pytest.approx(30 / 231)


def test_old_rows_and_uneven_ones_are_told() -> None:
    monitor = connected()
    for number in range(500):
        monitor.take(1, batch(number, late_ns=(number % 2) * 120_000_000), 200_000_000)
    quality = monitor.quality(10 * SECOND)
    assert quality.health is Health.FAIR
    assert quality.reasons == ("rows are 200 ms old when they come", "rows come unevenly, by 120 ms")


def test_a_link_that_is_made_again_is_told_for_a_minute() -> None:
    monitor = connected()
    monitor.state(ConnectionState.WAITING, "gone", SECOND)
    monitor.state(ConnectionState.CONNECTED, None, 2 * SECOND)
    now_ns = streamed(monitor, 10)
    assert monitor.quality(now_ns).reconnects == 1
    assert monitor.quality(now_ns).reasons == ("the link was made again in the last minute, 1×",)
    assert monitor.quality(now_ns + 70 * SECOND).reconnects == 0
