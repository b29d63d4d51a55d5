"""Who one is on a robot, and what one may not, as the terminal shows it."""

import pytest
from rich.text import Text

from gateway.client import ConnectionState
from gateway.wire.robot import Hello
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.robot import Robot
from server_gui.terminal import marks
from server_gui.terminal.controls import Controls
from server_gui.terminal.keys import Key
from server_gui.terminal.panels import footer
from tests.support.desk import FakeCommands
from tests.support.terminal_robot import a_station, screen


@pytest.mark.parametrize("size", [(118, 27), (80, 24)])
def test_the_dashboard_says_who_one_is(size: tuple[int, int]) -> None:
    station = a_station()
    assert " as " not in screen(station, size=size).splitlines()[1]
    station.robot.hello = Hello(1, "exo-01", "viewer", "b", identity="anna")
    assert "anna, as viewer" in screen(station, size=size)


VIEWER = "anna is a viewer on this robot, and this is for an operator; ask one"
OPERATOR = "anna is an operator on this robot, and this is for a maintainer; ask one"


@pytest.mark.parametrize("size", [(118, 27), (80, 24)])
@pytest.mark.parametrize(
    ("refused", "grey", "why"),
    [
        (
            {"control.acquire": VIEWER, "parameter.write": VIEWER, "robot.reset": VIEWER},
            {"change", "reset"},
            VIEWER,
        ),
        ({"robot.reset": OPERATOR}, {"reset"}, OPERATOR),
        ({}, set(), ""),
    ],
)
def test_what_one_may_not_is_grey_and_says_why_and_stop_is_not(
    refused: dict[str, str], grey: set[str], why: str, size: tuple[int, int]
) -> None:
    station = a_station()
    station.robot.hello = Hello(1, "exo-01", "viewer", "b", identity="anna", refused=refused)
    keys, _news = footer(station, Controls(station), "127.0.0.1:7420").renderables
    assert isinstance(keys, Text)
    greyed = " ".join(keys.plain[span.start : span.end] for span in keys.spans if span.style == marks.OLD)
    assert {word for word in ("STOP", "choose", "change", "reset", "quit") if word in greyed} == grey
    controls = Controls(station)
    shown = "╰─ anna is a viewer on this" if "change" in grey else "╰───"
    station.robot.parameters_at_ns = None
    assert shown in screen(station, controls, size)
    for key in (Key.LEFT, Key.RESET):
        controls.press(key)
    assert (f"✕ {why[:60]}" in screen(station, controls, size)) == bool(why)


@pytest.mark.parametrize("size", [(118, 27), (100, 24), (80, 24)])
def test_why_a_robot_was_never_reached_is_read_to_its_end(size: tuple[int, int]) -> None:
    """It was cut before it said what to do, and nothing else on the screen does."""
    why = "this desk is not paired with it (gwrms keys pair on the robot, then gwrms pair HOST:7421 here)"
    station = a_station()
    station.robot = Robot()
    station.robot.apply(LinkChanged(ConnectionState.CLOSED, why, 0))
    shown = " ".join(screen(station, size=size).split())
    assert why in shown
    assert "STOP (software, not safety-rated)" in shown


@pytest.mark.parametrize("key", [Key.LEFT, Key.RIGHT, Key.RESET])
def test_a_key_that_one_may_not_press_sends_nothing_and_says_why(
    key: Key, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, now_s = FakeCommands(), 100.0
    monkeypatch.setattr("time.monotonic", lambda: now_s)
    controls = Controls(station := a_station(asked))
    methods = ("control.acquire", "parameter.write", "robot.reset")
    station.robot.hello = Hello(1, "exo-01", "viewer", "b", refused=dict.fromkeys(methods, VIEWER))
    controls.press(key)
    controls.press(key)
    assert asked.named("write") == asked.named("reset") == []
    assert (controls.refusal, controls.asks_again) == (VIEWER, False)
    now_s += 5.0
    assert controls.refusal == "", "what matters more is told again"
    controls.press(key)
    controls.press(Key.STOP)
    assert len(asked.named("stop")) == 1
    assert controls.refusal == ""
