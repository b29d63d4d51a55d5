"""The simulated clock: order, cancelling, repetition."""

from hil_sim.clock import Clock


def test_events_happen_in_order_of_time_then_of_making() -> None:
    clock, seen = Clock(), list[str]()
    clock.at(20, lambda: seen.append("late"))
    clock.at(10, lambda: seen.append("first"))
    clock.at(10, lambda: seen.append("second"))
    clock.run_until(15)
    assert seen == ["first", "second"]
    assert clock.now_ns == 15
    assert clock.next_due_ns() == 20


def test_an_event_sees_its_own_time_and_may_make_others() -> None:
    clock, seen = Clock(), list[int]()

    def make_another() -> None:
        clock.after(5, lambda: seen.append(clock.now_ns))

    clock.at(10, make_another)
    clock.run_until(100)
    assert seen == [15]


def test_a_cancelled_event_does_not_happen() -> None:
    clock, seen = Clock(), list[int]()
    clock.at(10, lambda: seen.append(1)).cancel()
    assert clock.next_due_ns() is None
    clock.run_until(100)
    assert seen == []


def test_a_repeating_action_does_not_drift_and_ends_when_cancelled() -> None:
    clock, seen = Clock(), list[int]()
    repeating = clock.every(10, lambda: seen.append(clock.now_ns))
    clock.run_until(35)
    repeating.cancel()
    clock.run_until(100)
    assert seen == [10, 20, 30]
