"""The simulated bus: arbitration, time on the wire, no echo."""

import pytest

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import SECOND_NS, Clock


def test_the_lowest_identifier_wins_while_others_wait() -> None:
    clock = Clock()
    bus = CanBus(clock)
    seen = list[int]()
    bus.attach("listener", lambda frame, _: seen.append(frame.cob_id))
    for cob_id in (0x700, 0x300, 0x80, 0x181):
        bus.send(Frame(cob_id), "sender")
    clock.run_until(SECOND_NS)
    assert seen == [0x700, 0x80, 0x181, 0x300]  # the first one had the bus already


def test_a_standard_frame_beats_an_extended_one_with_the_same_first_bits() -> None:
    assert Frame(0x100).arbitration() < Frame(0x100 << 18, extended=True).arbitration()
    assert Frame(0x100).arbitration() < Frame(0x100, remote=True).arbitration()


def test_a_sender_does_not_hear_itself() -> None:
    clock = Clock()
    bus = CanBus(clock)
    seen = list[str]()
    bus.attach("a", lambda _frame, _sender: seen.append("a"))
    bus.attach("b", lambda _frame, _sender: seen.append("b"))
    bus.attach("c", lambda _frame, _sender: seen.append("c"))
    bus.send(Frame(1), "b")
    clock.run_until(SECOND_NS)
    assert seen == ["a", "c"]


@pytest.mark.parametrize(("bitrate", "frames"), [(1_000_000, 8457), (500_000, 4228), (125_000, 1057)])
def test_a_second_carries_what_the_bit_rate_allows(bitrate: int, frames: int) -> None:
    clock = Clock()
    bus = CanBus(clock, bitrate)
    for _ in range(10_000):
        bus.send(Frame(0x181, bytes(8)), "sender")
    clock.run_until(SECOND_NS)
    assert bus.frames_carried == pytest.approx(frames, abs=2)
    assert bus.pending >= 10_000 - frames - 3
    assert bus.busy_ns == pytest.approx(SECOND_NS, rel=1e-3)
