"""Frames that go missing are told of every sensor, whether it counts them or not."""

import pytest

from drivers.parsing import Counters
from drivers.reader_stalls import ReaderStalls
from drivers.sensor_losses import Losses

SECOND_NS = 1_000_000_000


def fed(
    losses: Losses,
    counters: Counters,
    began_s: float,
    seconds: float,
    rate_hz: float,
    step_s: float = 0.02,
    *,
    numbered: bool = False,
) -> float:
    """Frames at this rate, `step_s` between two deliveries."""
    done = round(seconds / step_s)
    before = counters.frames
    for step in range(1, done + 1):
        counters.frames = before + round(step * step_s * rate_hz)
        losses.update(round((began_s + step * step_s) * SECOND_NS), counters, numbered=numbered)
    return began_s + seconds


@pytest.mark.parametrize("step_s", [0.01, 0.016, 0.5])
def test_fewer_frames_than_before_are_told_until_as_many_come(step_s: float) -> None:
    losses, counters = Losses(ReaderStalls()), Counters()
    now_s = fed(losses, counters, 0.0, 30.0, 100.0, step_s)
    assert list(losses.findings) == []
    now_s = fed(losses, counters, now_s, 20.0, 80.0, step_s)
    finding = losses.findings[0]
    assert finding.words == "80 frames a second come, 100 came before"
    assert "cable" in finding.check
    assert finding.since_ns < (now_s - 8.0) * SECOND_NS
    fed(losses, counters, now_s, 20.0, 100.0, step_s)
    assert list(losses.findings) == []


def test_what_the_port_had_kept_at_first_is_no_rate() -> None:
    losses, counters = Losses(ReaderStalls()), Counters()
    counters.frames = 1
    losses.update(0, counters, numbered=False)
    counters.frames = 100  # at once, what had waited
    fed(losses, counters, 0.01, 40.0, 100.0)
    assert list(losses.findings) == []


def test_a_stall_of_ours_is_no_loss() -> None:
    losses, counters = Losses(ReaderStalls()), Counters()
    now_s = fed(losses, counters, 0.0, 20.0, 100.0)
    counters.frames += 300  # three seconds, delivered together
    fed(losses, counters, now_s + 3.0, 20.0, 100.0)
    assert list(losses.findings) == []


def test_a_line_that_was_plugged_in_anew_begins_anew() -> None:
    losses, counters = Losses(ReaderStalls()), Counters()
    fed(losses, counters, 0.0, 20.0, 100.0)
    losses.restart()
    fed(losses, counters, 30.0, 20.0, 50.0)
    assert list(losses.findings) == []


def test_a_sensor_that_numbers_its_frames_may_send_fewer_and_is_told_of_each_gap() -> None:
    losses, counters = Losses(ReaderStalls()), Counters()
    now_s = fed(losses, counters, 0.0, 20.0, 100.0, numbered=True)
    now_s = fed(losses, counters, now_s, 20.0, 50.0, numbered=True)
    assert list(losses.findings) == []
    for step in range(1, 1001):
        counters.frames += step % 5 != 0
        counters.frames_missed += step % 5 == 0
        losses.update(round((now_s + step * 0.01) * SECOND_NS), counters, numbered=True)
    assert [finding.words for finding in losses.findings] == ["20 % of its frames are missing"]
