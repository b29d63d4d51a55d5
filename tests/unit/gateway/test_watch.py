"""The watch over a held stop: whom it asks to stop again, and whom it leaves alone for a while."""

import time
from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any, cast

import pytest

from drivers.errors import DeviceTimeout
from drivers.joint.quick_stop import StopOutcome
from gateway.modules.stop.authority import Authority
from gateway.modules.stop.controllers import Controller, Controllers
from gateway.modules.stop.machine import Input, Phase, ResetFinding
from gateway.modules.stop.reset import Lowering
from gateway.modules.stop.stopper import Stopper
from gateway.modules.stop.target import Report
from gateway.modules.stop.watch import AT_LEAST_S, LOOK_S, StopWatch
from gateway.process.futures import done, failed
from gateway.process.loop import Loop


class Unseen:
    """An axis of which nothing is heard; `idle_s` after its last stop."""

    def __init__(self, node: object, idle_s: float) -> None:
        latest = SimpleNamespace(read=lambda _index, _now_ns: (None, None))
        self.drive = SimpleNamespace(node=node, channels=(), latest=latest)
        self.idle_s = idle_s
        self.running = False
        self.asked = 0

    def stop(self) -> None:
        self.asked += 1


def look(**axes: Unseen) -> None:
    """One look over a stop that is held."""
    authority = Authority(axes, ())
    authority.feed(Input.STOP, lambda _step: None)
    stoppers = cast("dict[str, Stopper]", axes)
    nothing: Any = lambda *_what: None  # noqa: E731 - it takes whatever is told
    StopWatch(authority, stoppers, {}, nothing, nothing).look()


@pytest.mark.parametrize(("idle_s", "asked"), [(0.0, 0), (LOOK_S / 2, 0), (LOOK_S, 1), (AT_LEAST_S, 1)])
def test_a_node_has_time_between_two_stops_to_come_up_and_to_be_read(idle_s: float, asked: int) -> None:
    """A stop interrupts every read: asked again at once, a trial's end behind one would never come."""
    knee = Unseen(object(), idle_s)
    look(knee=knee)
    assert knee.asked == asked


@pytest.mark.parametrize(("idle_s", "asked"), [(LOOK_S, 0), (AT_LEAST_S, 1)])
def test_the_stop_of_another_axis_keeps_a_node_busy_too_but_not_for_ever(idle_s: float, asked: int) -> None:
    node = object()
    first, second = Unseen(node, idle_s), Unseen(node, LOOK_S / 2)
    look(first=first, second=second)
    assert (first.asked, second.asked) == (asked, 0)


def test_another_node_does_not() -> None:
    first, second = Unseen(object(), LOOK_S), Unseen(object(), 0.0)
    look(first=first, second=second)
    assert (first.asked, second.asked) == (1, 0)


def test_a_controller_that_is_only_asked_to_stop_keeps_no_reset_from_its_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It enables drives and cannot be reached: each of its stops goes ahead of the reading."""
    monkeypatch.setattr("gateway.modules.stop.reset.LOOK_S", 0.05)
    loop = Loop()
    never: Future[ResetFinding] = Future()
    gait = SimpleNamespace(stop=lambda **_how: done(Report(StopOutcome.UNREACHABLE)), wake=lambda: None)
    gait.look = lambda: never
    controllers = cast("Controllers", SimpleNamespace(targets={"gait": gait}, absent={}))
    found = Lowering(loop, {}, {}, controllers).run(lambda: True)
    found.add_done_callback(lambda _found: loop.stop())
    loop.call_later(30.0, loop.stop)
    loop.run()
    assert found.result(0).problems == {"gait": "it was not read within 0.05 s"}
    assert not found.result(0).findings["gait"].at_rest
    loop.close()


def at_rest(*names: str) -> dict[str, ResetFinding]:
    return {name: ResetFinding(at_rest=True, asked_ns=time.monotonic_ns()) for name in names}


@pytest.mark.parametrize("is_being_proved", [False, True])
def test_nobody_who_is_led_down_is_stopped_by_a_look(is_being_proved: bool) -> None:
    """It would overtake the way down, or the end of the hold that was proved."""
    knee = Unseen(object(), AT_LEAST_S)
    authority = Authority({"knee"}, ())
    authority.feed(Input.STOP, _nothing)
    reset = authority.feed(Input.RESET, _nothing)
    if is_being_proved:
        authority.feed(Input.PROVED, _nothing, number=reset.number, findings=at_rest("knee"))
    assert authority.state.phase is (Phase.RELEASING if is_being_proved else Phase.RESETTING)
    StopWatch(authority, cast("dict[str, Stopper]", {"knee": knee}), {}, _nothing, _nothing).look()
    assert knee.asked == 0


@pytest.mark.parametrize("error", [DeviceTimeout("gait", "no answer"), None])
def test_a_controller_that_does_not_tell_whether_it_is_stopped_is_asked_to_stop(
    error: Exception | None,
) -> None:
    asked: list[str] = []
    told = done(ResetFinding(at_rest=True, asked_ns=1)) if error is None else failed(error)
    gait = SimpleNamespace(running=False, look=lambda: told, stop=lambda: asked.append("stop"))
    authority = Authority({"gait"}, ())
    authority.feed(Input.STOP, _nothing)
    StopWatch(authority, {}, cast("dict[str, Controller]", {"gait": gait}), _nothing, _nothing).look()
    assert asked == ([] if error is None else ["stop"])


def _nothing(*_what: object) -> None:
    """Takes whatever is told."""
