"""Keys, controls, drawings: what the terminal does with a robot's state."""

import concurrent.futures
import io
import math
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from gateway.client import Batch, ConnectionState
from gateway.wire.messages import (
    Clock,
    ComponentInfo,
    Description,
    GuardInfo,
    ParameterInfo,
    ParameterValue,
    ParameterValues,
    QualityInfo,
    Snapshot,
    StopInfo,
    Stopped,
    Written,
)
from server_gui.core.follow.events import (
    STOP,
    Changed,
    Described,
    Failed,
    LinkChanged,
    Looked,
    StopAnswered,
    Telemetry,
)
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import Gait, LegGait
from server_gui.terminal import headless, marks
from server_gui.terminal.controls import Controls, neighbour, step_of
from server_gui.terminal.dashboard import draw
from server_gui.terminal.keys import Key, KeyParser


def parameter(
    name: str, low: float | None, high: float | None, largest: float | None = None
) -> ParameterInfo:
    return ParameterInfo(name, "m", low, high, largest, True, None, "gait", "0x2001:0", "rw", False)


class Recorder:
    """Notes what was asked for, and answers when the test says so."""

    def __init__(self) -> None:
        self.writes: list[dict[str, float]] = []
        self.stops: list[str] = []
        self.answer: concurrent.futures.Future[None] = concurrent.futures.Future()

    def write(self, changes: Mapping[str, float]) -> "concurrent.futures.Future[None]":
        self.writes.append(dict(changes))
        return self.answer

    def stop(self, reason: str) -> "concurrent.futures.Future[None]":
        self.stops.append(reason)
        return self.answer


def a_robot(at_ns: int = 0) -> Robot:
    robot = Robot()
    robot.apply(LinkChanged(ConnectionState.CONNECTED, None, at_ns))
    parts = [("left_knee", "joint"), ("left_insole", "insole"), ("trunk", "imu"), ("gait", "device")]
    parameters = [parameter("gait.step_length", 0.2, 0.6, 0.1), parameter("gait.free", None, None)]
    robot.apply(
        Described(
            Description(
                robot="exo-01",
                boot_id="b",
                role="observer",
                components=[ComponentInfo(name, kind, "ok") for name, kind in parts],
                channels=[],
                parameters=parameters,
                modules={},
                clock=Clock(0, 0, "b"),
                stop=StopInfo(False, None, None, {}, {}),
                guard=GuardInfo(),
            )
        )
    )
    values = {
        "gait.step_length": ParameterValue(0.4, "m", 0.2, 0.6, 0),
        "gait.free": ParameterValue(1.0, "", None, None, 0),
    }
    robot.apply(Looked(Snapshot(0, {}, {}, {}), ParameterValues(values), at_ns))
    return robot


def screen(
    robot: Robot, controls: Controls, size: tuple[int, int] = (118, 27), gait: Gait | None = None
) -> str:
    console = Console(width=size[0], height=size[1], file=io.StringIO(), record=True, force_terminal=True)
    console.print(draw(robot, gait or Gait(), controls, "127.0.0.1:7420", size), height=size[1])
    return console.export_text()


# --- keys


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"s", [Key.STOP]),
        (b" ", [Key.STOP]),
        (b"q", [Key.QUIT]),
        (b"\x1b[A\x1b[B", [Key.UP, Key.DOWN]),
        (b"\x1bOC\x1bOD", [Key.RIGHT, Key.LEFT]),
        (b"xyz", []),
        (b"\x1b[1;5As", [Key.STOP]),
        (b"\x1bs", [Key.STOP]),
    ],
)
def test_bytes_become_keys_at_every_split_point(data: bytes, keys: list[Key]) -> None:
    for split in range(len(data) + 1):
        parser = KeyParser()
        assert parser.feed(data[:split]) + parser.feed(data[split:]) == keys


@given(st.binary(max_size=200))
def test_garbage_never_hides_a_stop(garbage: bytes) -> None:
    parser = KeyParser()
    parser.feed(garbage)
    assert Key.STOP in parser.feed(b"s" * 20)


# --- controls


def test_arrows_choose_and_move_by_one_step() -> None:
    asked = Recorder()
    controls = Controls(a_robot(), asked)
    assert controls.selected == "gait.step_length"
    controls.press(Key.RIGHT)
    assert asked.writes == [{"gait.step_length": 0.42}]


def test_key_during_a_write_is_not_queued() -> None:
    asked = Recorder()
    controls = Controls(a_robot(), asked)
    controls.press(Key.RIGHT)
    controls.press(Key.RIGHT)
    assert len(asked.writes) == 1
    asked.answer.set_result(None)
    controls.press(Key.LEFT)
    assert asked.writes[1:] == [{"gait.step_length": 0.38}]


def test_parameter_without_limits_is_not_moved() -> None:
    asked = Recorder()
    controls = Controls(a_robot(), asked)
    controls.press(Key.DOWN)
    controls.press(Key.RIGHT)
    assert controls.selected == "gait.free"
    assert asked.writes == []
    assert "gwrms set gait.free" in controls.note


def test_parameter_whose_value_is_not_known_is_not_moved() -> None:
    robot = a_robot()
    robot.parameters = {"gait.step_length": ParameterValue(None, "m", 0.2, 0.6, None, "no answer")}
    asked = Recorder()
    Controls(robot, asked).press(Key.RIGHT)
    assert asked.writes == []


def test_stop_goes_out_also_during_a_write_and_each_time() -> None:
    asked = Recorder()
    controls = Controls(a_robot(), asked)
    controls.press(Key.RIGHT)
    controls.press(Key.STOP)
    controls.press(Key.STOP)
    assert len(asked.stops) == 2


@pytest.mark.parametrize(
    ("low", "high", "largest", "step"),
    [(0.2, 0.6, 0.1, 0.02), (0.2, 0.6, 0.005, 0.005), (0.0, 2000.0, None, 100.0), (-0.1, 0.3, None, 0.02)],
)
def test_step_is_round_and_within_the_largest(
    low: float, high: float, largest: float | None, step: float
) -> None:
    assert step_of(low, high, largest) == pytest.approx(step)


@given(
    low=st.floats(-1000, 1000),
    span=st.floats(0.01, 1000),
    share=st.floats(0, 1),
    by=st.sampled_from([-1, 1]),
    largest=st.none() | st.floats(0.001, 10),
)
def test_neighbour_stays_within_limits_and_goes_the_right_way(
    low: float, span: float, share: float, by: int, largest: float | None
) -> None:
    info = parameter("x", low, low + span, largest)
    value = min(max(low + share * span, low), low + span)
    target = neighbour(value, by, info)
    assert target is not None
    assert low - 1e-9 <= target <= low + span + 1e-9
    assert (target - value) * by >= -1e-9
    if largest is not None:
        assert abs(target - value) <= largest + 1e-9


# --- drawings


def test_state_is_shape_and_word() -> None:
    assert marks.state_text("OPERATION ENABLED").plain == "● operation enabled"
    assert marks.state_text("SWITCH_ON_DISABLED").plain == "○ switch on disabled"
    assert marks.state_text("something new").plain == "? something new"


def test_sparkline_leaves_a_hole_where_nothing_was() -> None:
    assert marks.sparkline([0.0, None, 1.0], 0.0, 1.0, 5) == "  ▁ █"


def test_needle_marks_zero_and_the_value() -> None:
    assert marks.needle(1.0, -1.0, 1.0, 5) == "──┼─◆"
    assert marks.needle(None, -1.0, 1.0, 5) == "──┼──"
    assert marks.needle(9.0, 0.0, 1.0, 3) == "──◆"


def test_scale_stands_above_the_ends_and_the_zero_of_its_needle() -> None:
    low, high = math.radians(-30), math.radians(75)
    assert marks.scale(low, high, 22) == "-30°  0°           75°"
    assert marks.needle(None, low, high, 22).index("┼") == 6


@pytest.mark.parametrize("size", [(118, 27), (80, 24), (160, 45)])
def test_live_values_are_shown_in_degrees_and_newtons(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    robot = a_robot()
    _feed(robot, {"left_knee.position": [math.radians(30)], "left_insole.force": [512.0]})
    monkeypatch.setattr("time.monotonic_ns", lambda: 1_000_000)
    text = screen(robot, Controls(robot, Recorder()), size)
    assert "left knee" in text
    assert "+30.0°" in text
    assert "512 N" in text
    assert "▶ gait.step_length" in " ".join(text.split())
    assert "● ok" in text
    assert "old" not in text


def test_old_values_say_how_old_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = a_robot()
    _feed(robot, {"left_knee.position": [0.5]})
    monkeypatch.setattr("time.monotonic_ns", lambda: 3_000_000_000)
    text = screen(robot, Controls(robot, Recorder()))
    assert "Joints 3.0 s old" in text
    assert "◌ stale" in text


def test_missing_value_is_a_dash_and_lost_is_named_with_its_reason() -> None:
    robot = a_robot()
    lost: QualityInfo = {"state": "lost", "age_ms": 2500.0, "problem": "no heartbeat from node 2"}
    robot.apply(Looked(Snapshot(0, {}, {}, {"left_knee": lost}), None, 0))
    _feed(robot, {"left_knee.position": [None]})
    text = screen(robot, Controls(robot, Recorder()))
    assert "✕ lost 2.5 s" in text
    assert "left_knee lost: no heartbeat from node 2" in text


def test_dropped_link_is_said_before_anything_else() -> None:
    robot = a_robot()
    robot.apply(LinkChanged(ConnectionState.WAITING, "no gateway at 127.0.0.1:7420", 0))
    text = screen(robot, Controls(robot, Recorder()))
    assert "✕ waiting" in text
    assert "no gateway at 127.0.0.1:7420" in text


def test_write_is_shown_as_read_back() -> None:
    robot = a_robot()
    robot.apply(Changed(Written(1, {"gait.step_length": 0.4}, {"gait.step_length": 0.42})))
    assert "✓ gait.step_length 0.4 → 0.42, read back" in screen(robot, Controls(robot, Recorder()))


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "STOP sent"),
        (StopAnswered(Stopped({"left_knee": "confirmed"}, True)), "STOP confirmed by all 1 drives"),
        (
            StopAnswered(Stopped({"left_knee": "unreachable"}, True)),
            "STOP NOT CONFIRMED: left_knee unreachable",
        ),
        (StopAnswered(Stopped({}, True)), "STOP NOT CONFIRMED: no drives"),
        (Failed(STOP, "there is no link"), "STOP NOT CONFIRMED: there is no link"),
    ],
)
def test_stop_is_confirmed_only_by_every_drive(answer: StopAnswered | Failed | None, words: str) -> None:
    robot = a_robot()
    controls = Controls(robot, Recorder())
    controls.press(Key.STOP)
    if answer is not None:
        robot.apply(answer)
    assert words in screen(robot, controls)


def test_empty_robot_can_be_drawn() -> None:
    robot = Robot()
    assert "not known yet" in screen(robot, Controls(robot, Recorder()))


def test_headless_line_has_a_dash_for_what_is_missing() -> None:
    robot = a_robot()
    _feed(robot, {"left_knee.position": [None], "left_insole.force": [300.4]})
    line = headless.line(robot, Gait(), 7.0)
    assert "joints – °" in line
    assert "feet 300 N" in line
    assert "– steps/min" in line


@pytest.mark.parametrize(
    ("size", "words"), [((118, 27), "74 steps/min, stance 61 / 58 %"), ((80, 24), "74 steps/min")]
)
def test_dashboard_shows_how_the_wearer_walks(size: tuple[int, int], words: str) -> None:
    legs = {Leg.LEFT: LegGait(stance=0.612), Leg.RIGHT: LegGait(stance=0.58)}
    robot = a_robot()
    assert words in screen(robot, Controls(robot, Recorder()), size, Gait(True, 74.2, legs=legs))
    assert "steps/min" not in screen(robot, Controls(robot, Recorder()), size)


def _feed(robot: Robot, columns: dict[str, list[float | None]]) -> None:
    robot.apply(Telemetry(1, Batch([0], columns, 0, 0, 0, 1, 0), None))
