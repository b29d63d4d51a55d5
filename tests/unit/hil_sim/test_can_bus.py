"""The simulated bus: arbitration, time on the wire, no echo."""

import pytest

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.bus.load import LoadWatch
from hil_sim.clock import MILLISECOND_NS, SECOND_NS, Clock


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


def test_a_participant_that_filters_gets_only_the_standard_frames_it_accepts() -> None:
    clock = Clock()
    bus = CanBus(clock)
    seen = list[Frame]()
    bus.attach("filtering", lambda frame, _: seen.append(frame))

    def carry(*frames: Frame) -> list[Frame]:
        seen.clear()
        for frame in frames:
            bus.send(frame, "sender")
        clock.run_until(clock.now_ns + SECOND_NS)
        return list(seen)

    sent = Frame(0x80), Frame(0x181), Frame(0x181, extended=True)
    assert len(carry(*sent)) == 3
    bus.accept("filtering", {0x181})
    assert carry(*sent) == [Frame(0x181)]
    bus.accept("filtering", {0x80})
    assert carry(*sent) == [Frame(0x80)]
    bus.detach("filtering")
    assert carry(*sent) == []
    bus.attach("filtering", lambda frame, _: seen.append(frame))
    assert len(carry(*sent)) == 3


def overloading(clock: Clock, bus: CanBus, frames_a_millisecond: int) -> None:
    for number in range(frames_a_millisecond):
        frame = Frame(0x181 + number, bytes(8))
        clock.every(MILLISECOND_NS, lambda frame=frame: bus.send(frame, "sender"))  # type: ignore[misc]


def test_more_than_the_bit_rate_carries_is_said_lost_at_last_and_never_carried() -> None:
    clock = Clock()
    bus = CanBus(clock)
    said = list[str]()
    LoadWatch(bus, said.append)
    seen = list[int]()
    bus.attach("listener", lambda frame, _: seen.append(frame.cob_id))
    overloading(clock, bus, frames_a_millisecond=16)
    clock.run_until(4 * SECOND_NS)
    assert bus.busy_ns == pytest.approx(4 * SECOND_NS, rel=1e-3)
    assert len(seen) == pytest.approx(4 * 8457, rel=1e-3)
    assert seen.count(0x181) == pytest.approx(4000, abs=2)  # who wins arbitration notices nothing
    assert seen.count(0x181 + 15) == 0
    assert bus.frames_lost > 0
    assert bus.pending < 20_000
    assert len(said) == 1
    assert said[0].startswith("the bus is overloaded at 1 Mbit/s: ")


def test_an_overload_that_is_over_is_said_and_a_nearly_full_bus_is_none() -> None:
    clock = Clock()
    bus = CanBus(clock)
    said = list[str]()
    LoadWatch(bus, said.append)
    overloading(clock, bus, frames_a_millisecond=8)
    clock.run_until(2 * SECOND_NS)
    assert said == []
    for _ in range(1000):
        bus.send(Frame(0x100, bytes(8)), "sender")
    clock.run_until(7 * SECOND_NS)
    assert [sentence.split(" at ")[0] for sentence in said] == [
        "the bus is overloaded",
        "the bus is no longer overloaded",
    ]
