"""A device's clock related to the robot's: wraps, drift, jitter, gaps, late frames, restarts."""

import itertools
import math
import random
from collections.abc import Iterator

import pytest

from drivers.clock import SECOND_NS, DeviceClock

MICROSECONDS = 1_000_000


def run(
    clock: DeviceClock, rate_hz: float, seconds: float, drift: float, jitter_s: float, seed: int = 1
) -> Iterator[tuple[float, int, int | None]]:
    """A device that sends µs counters: (true time in s, received in ns, stamp)."""
    chance = random.Random(seed)
    last_ns = 0
    for number in range(int(seconds * rate_hz)):
        true_s = 1000 + number / rate_hz
        device_us = int(true_s * (1 - drift) * 1e6) & 0xFFFFFFFF
        received_ns = max(last_ns, round((true_s + chance.random() * jitter_s) * 1e9))
        last_ns = received_ns
        yield true_s, received_ns, clock.stamp(device_us, received_ns)


@pytest.mark.parametrize("drift", [0.0, 50e-6, -50e-6, 0.01, -0.01])
def test_jitter_of_the_way_does_not_reach_the_samples(drift: float) -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    errors = [
        stamp / 1e9 - true_s
        for true_s, _, stamp in run(clock, 200, 40, drift, jitter_s=0.016)
        if stamp is not None and true_s > 1010
    ]
    assert len(errors) > 5000
    assert max(map(abs, errors)) < 0.002
    assert clock.drift == pytest.approx(drift / (1 - drift), abs=30e-6)  # per second of the device


def test_stated_uncertainty_covers_the_error() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    judged = 0
    for true_s, _, stamp in run(clock, 200, 60, 80e-6, jitter_s=0.010):
        if stamp is not None and clock.uncertainty_ns is not None and true_s > 1010:
            assert abs(stamp - true_s * 1e9) <= clock.uncertainty_ns + 300_000
            judged += 1
    assert judged > 5000


def test_stamps_rise_and_are_never_after_reception() -> None:
    clock, last = DeviceClock(MICROSECONDS, 1 << 32), 0
    for _, received_ns, stamp in run(clock, 200, 20, -20e-6, jitter_s=0.05):
        assert stamp is not None
        assert last < stamp <= received_ns
        last = stamp


def test_frames_that_come_in_one_read_are_spread_to_when_they_were_taken() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    stamps = []
    for number in range(400):
        received_ns = (number // 4 * 4 + 3) * 5_000_000 + SECOND_NS  # four frames each 20 ms
        stamps.append(clock.stamp(number * 5000, received_ns) or 0)
    steps = [after - before for before, after in itertools.pairwise(stamps[40:])]
    assert set(steps) == {5_000_000}


def test_a_whole_day_with_wraps_and_changing_drift() -> None:
    clock, chance = DeviceClock(MICROSECONDS, 1 << 32), random.Random(7)
    device_us, worst, wraps, before = 0.0, 0.0, 0, 0
    for true_s in range(0, 24 * 3600, 8):
        drift = 40e-6 + 20e-6 * math.sin(true_s / 86400 * 2 * math.pi)  # with the day's temperature
        device_us += 8e6 * (1 - drift)
        ticks = int(device_us) & 0xFFFFFFFF
        wraps += ticks < before
        before = ticks
        stamp = clock.stamp(ticks, round((5.0 + true_s + 0.004 * chance.random()) * 1e9))
        assert stamp is not None
        if true_s > 30:
            worst = max(worst, abs(stamp / 1e9 - 5.0 - true_s))
    assert wraps == 20  # 86400 s / 4294.97 s
    assert clock.restarts == 0
    assert worst < 0.005


def test_late_and_repeated_frames_have_no_stamp_and_move_nothing() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    for number in range(100):
        clock.stamp(number * 5000, SECOND_NS + number * 5_000_000)
    assert clock.stamp(99 * 5000, SECOND_NS + 500_000_000) is None
    assert clock.stamp(50 * 5000, SECOND_NS + 501_000_000) is None
    assert clock.stamp(101 * 5000, SECOND_NS + 506_000_000) == SECOND_NS + 101 * 5_000_000


def test_late_frame_from_before_the_wrap() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    assert clock.stamp((1 << 32) - 5000, SECOND_NS) is not None
    assert clock.stamp(5000, SECOND_NS + 10_000_000) is not None
    assert clock.stamp((1 << 32) - 1, SECOND_NS + 11_000_000) is None


def test_silence_of_many_wraps_is_bridged_by_the_robots_clock() -> None:
    clock = DeviceClock(100, 256)  # a sample index at 100 Hz wraps every 2.56 s
    for number in range(1000):
        clock.stamp(number % 256, number * 10_000_000)
    number += 12_345
    assert clock.stamp(number % 256, number * 10_000_000 + 3_000_000) is not None
    assert clock.restarts == 0


def test_device_that_restarts_is_followed_and_counted() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    for number in range(400):
        clock.stamp(10_000_000 + number * 5000, SECOND_NS + number * 5_000_000)
    before = clock.stamp(12_000_000, 3 * SECOND_NS)
    after = clock.stamp(0, 4 * SECOND_NS)
    assert clock.restarts == 1
    assert before is not None
    assert after is not None
    assert before < after <= 4 * SECOND_NS


@pytest.mark.parametrize("pause_s", [0.05, 0.3, 0.9])
def test_a_counter_that_stands_still_again_and_again_does_not_make_its_samples_old(pause_s: float) -> None:
    """As of a device whose processor has too much to do; 0.9 s in every two."""
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    ages_s, paused_s = [], 0.0
    for number in range(200 * 120):
        if number % 400 == 0:
            paused_s += pause_s
        received_ns = round((1000 + number / 200 + paused_s) * 1e9)
        stamp = clock.stamp(number * 5000, received_ns)
        assert stamp is not None
        ages_s.append((received_ns - stamp) / 1e9)
    assert max(ages_s) < 0.3 + 2 * pause_s
    assert clock.steps > 0 or pause_s < 0.1


@pytest.mark.parametrize("speed", [0.001, 0.2, 0.5, 0.7])
def test_a_counter_that_is_no_clock_makes_its_samples_old_for_no_more_than_its_first_seconds(
    speed: float,
) -> None:
    """As of a logger whose time is in another unit than its description says."""
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    for number in range(200 * 30):
        received_ns = round((1000 + number / 200) * 1e9)
        stamp = clock.stamp(round(number * 5000 * speed), received_ns)
        assert stamp is not None
        if number > 200 * 4:
            assert received_ns - stamp < 0.01 * SECOND_NS


def test_a_reader_that_was_slow_for_seconds_does_not_move_the_line() -> None:
    clock = DeviceClock(MICROSECONDS, 1 << 32)
    for number in range(200 * 40):
        true_s = 1000 + number / 200
        slow_s = 0.6 if 10 < true_s - 1000 < 13 else 0.0
        stamp = clock.stamp(number * 5000, round((true_s + slow_s) * 1e9))
        assert stamp is not None
        if true_s > 1014:
            assert abs(stamp / 1e9 - true_s) < 0.02
