"""Keys, controls, drawings: what the terminal does with a robot's state."""

import dataclasses
import math
from collections.abc import Callable
from concurrent.futures import Future

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from msgspec.structs import replace

from gateway.client import Batch, ConnectionState, LinkLost
from gateway.wire.component import ChannelInfo, QualityInfo, Snapshot
from gateway.wire.parameter import ParameterValue, Written
from gateway.wire.resource import MemoryUse
from gateway.wire.stop import Reset, Stopped
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Described, LinkChanged, Looked, Telemetry
from server_gui.core.follow.robot import Robot
from server_gui.core.processing.component import Derived
from server_gui.core.processing.gait_events import Leg
from server_gui.core.processing.gait_measures import Gait, LegGait
from server_gui.terminal import headless, marks
from server_gui.terminal.controls import Controls, neighbour, step_of
from server_gui.terminal.keys import Key, KeyParser
from tests.support.desk import FakeCommands, looked, resources, walking
from tests.support.terminal_robot import a_station, parameter, screen


@pytest.mark.parametrize("size", [(80, 24), (118, 27)])
def test_every_key_and_what_its_stop_is_not_are_in_sight(size: tuple[int, int]) -> None:
    (line,) = (line for line in screen(a_station(), size=size).splitlines() if "STOP" in line)
    assert "s  STOP (software, not safety-rated)" in line
    assert line.rstrip().endswith("q quit")


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
    asked = FakeCommands()
    controls = Controls(a_station(asked))
    assert controls.selected == "gait.step_length"
    controls.press(Key.RIGHT)
    assert asked.named("write") == [({"gait.step_length": 0.42}, None)]


def test_key_during_a_write_is_not_queued() -> None:
    asked = FakeCommands()
    controls = Controls(a_station(asked))
    controls.press(Key.RIGHT)
    controls.press(Key.RIGHT)
    assert len(asked.named("write")) == 1
    asked.answer(Written(1, {"gait.step_length": 0.4}, {"gait.step_length": 0.42}))
    controls.press(Key.LEFT)
    assert asked.named("write")[1:] == [({"gait.step_length": 0.4}, None)], "from what was read back"


def test_parameter_without_limits_is_not_moved() -> None:
    asked = FakeCommands()
    controls = Controls(a_station(asked))
    controls.press(Key.DOWN)
    controls.press(Key.RIGHT)
    assert controls.selected == "gait.free"
    assert asked.named("write") == []
    assert "gwrms set gait.free" in controls.note


def test_parameter_whose_value_is_not_known_is_not_moved() -> None:
    asked = FakeCommands()
    station = a_station(asked)
    station.robot.parameters = {"gait.step_length": ParameterValue(None, "m", 0.2, 0.6, None, "no answer")}
    Controls(station).press(Key.RIGHT)
    assert asked.named("write") == []


def test_stop_goes_out_also_during_a_write_and_each_time() -> None:
    asked = FakeCommands()
    controls = Controls(a_station(asked))
    controls.press(Key.RIGHT)
    controls.press(Key.STOP)
    controls.press(Key.STOP)
    assert len(asked.named("stop")) == 2


def test_what_a_stop_comes_to_is_shown_whatever_keys_were_pressed_meanwhile() -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.STOP)
    controls.press(Key.DOWN)
    station.take([LinkChanged(ConnectionState.WAITING, "no gateway at 127.0.0.1:7420", 0)])
    asked.fail(LinkLost("there is no link"))
    assert "STOP NOT CONFIRMED: there is no link" in screen(station, controls)


def test_what_a_stop_comes_to_is_waited_for_before_the_end() -> None:
    asked = FakeCommands()
    controls = Controls(a_station(asked))
    controls.press(Key.STOP)
    controls.press(Key.QUIT)
    assert not controls.is_over
    asked.answer(Stopped({"left_knee": "confirmed"}, True))
    assert controls.is_over


def test_what_a_reset_does_is_said_by_whether_a_stop_is_held() -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.STOP)
    asked.answer(Stopped({"left_knee": "confirmed"}, True))
    controls.press(Key.RESET)
    assert "r again ends the held stop" in screen(station, controls)


def test_how_to_go_on_after_a_stop_names_the_key_and_not_a_button_of_the_window() -> None:
    station = a_station(FakeCommands())
    station.take([walking(10), looked()])
    station.stopping.described(True, "test")
    said = screen(station, Controls(station))
    assert "to go on: r r once nobody is in danger" in " ".join(said.split())
    assert "Reset stop" not in said


def test_a_reset_needs_the_key_twice_within_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr("server_gui.terminal.controls.time.monotonic", lambda: now_s)
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.RESET)
    assert "r again takes power from every drive" in screen(station, controls)
    now_s += 10.0
    controls.press(Key.RESET)
    assert asked.named("reset") == []
    controls.press(Key.RESET)
    assert len(asked.named("reset")) == 1
    asked.answer(Reset({}, {"left_knee": "no answer"}, True))
    assert "stop still held: left_knee: no answer" in screen(station, controls)


@pytest.mark.parametrize(
    ("low", "high", "largest", "step"),
    [(0.2, 0.6, 0.1, 0.02), (0.2, 0.6, 0.005, 0.005), (0.0, 2000.0, None, 100.0), (-0.1, 0.3, None, 0.02)],
)
def test_step_is_round_and_within_the_largest(
    low: float, high: float, largest: float | None, step: float
) -> None:
    assert step_of(low, high, largest) == pytest.approx(step)


@given(
    value=st.floats(allow_nan=False, allow_infinity=False),
    ends=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 2),
    largest=st.none() | st.floats(0, 1e300),
    by=st.sampled_from([-1, 1]),
)
@example(value=0.0, ends=(-1.7e308, 1.7e308), largest=None, by=1)
@example(value=1e308, ends=(0.0, 0.5), largest=None, by=1)
@example(value=0.0, ends=(0.0, 5e-324), largest=None, by=1)
def test_whatever_a_robot_says_of_a_parameter_its_neighbour_is_within_its_limits_or_none(
    value: float, ends: tuple[float, float], largest: float | None, by: int
) -> None:
    low, high = min(ends), max(ends)
    target = neighbour(value, by, parameter("x", low, high, largest))
    assert target is None or low <= target <= high


@example(low=-1.192092896e-07, span=20.0, share=0.0, by=1, largest=1.0)
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
    assert marks.state_text("something new").plain == "▲ something new"


def test_sparkline_leaves_a_hole_where_nothing_was() -> None:
    assert marks.sparkline([0.0, None, 1.0], 0.0, 1.0, 5) == "  ▁ █"


def test_needle_marks_zero_and_the_value() -> None:
    assert marks.needle(1.0, -1.0, 1.0, 5) == "──┼─◆"
    assert marks.needle(None, -1.0, 1.0, 5) == "──┼──"
    assert marks.needle(9.0, 0.0, 1.0, 3) == "──◆"


NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(value=NUMBERS, low=NUMBERS, high=NUMBERS)
@example(value=1.7e308, low=-0.5, high=1.3)
@example(value=0.0, low=-1.7e308, high=1.7e308)
@example(value=2.0, low=2.0, high=2.0)
def test_no_number_of_a_robot_cannot_be_drawn(value: float, low: float, high: float) -> None:
    assert len(marks.needle(value, low, high, 9)) == 9
    assert len(marks.sparkline([value], low, high, 9)) == 9


def test_scale_stands_above_the_ends_and_the_zero_of_its_needle() -> None:
    low, high = math.radians(-30), math.radians(75)
    assert marks.scale(low, high, 22) == "-30°  0°           75°"
    assert marks.needle(None, low, high, 22).index("┼") == 6


@pytest.mark.parametrize("size", [(20, 5), (40, 10), (80, 12), (10, 2), (200, 3)])
def test_what_became_of_a_stop_is_shown_however_small_the_terminal_is(size: tuple[int, int]) -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.STOP)
    asked.fail(LinkLost("there is no link"))
    assert "STOP NOT C"[: size[0] - 1] in screen(station, controls, size)


def test_a_computer_without_memory_is_no_end_of_the_screen() -> None:
    station = a_station()
    seen = resources()
    station.take([dataclasses.replace(seen, snapshot=replace(seen.snapshot, memory=MemoryUse(0, 0, 0, 0)))])
    assert "memory" in screen(station)


@pytest.mark.parametrize("size", [(118, 27), (80, 24), (160, 45)])
def test_live_values_are_shown_in_degrees_and_newtons(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int]
) -> None:
    station = a_station()
    _feed(station, {"left_knee.position": [math.radians(30)], "left_insole.force": [512.0]})
    monkeypatch.setattr("time.monotonic_ns", lambda: 1_000_000)
    text = screen(station, size=size)
    assert "left knee" in text
    assert "+30.0°" in text
    assert "512 N" in text
    assert "▶ gait.step_length" in " ".join(text.split())
    assert "● ok" in text
    assert "old" not in text


def test_a_fault_is_shown_with_its_error_code(monkeypatch: pytest.MonkeyPatch) -> None:
    station = a_station()
    state = ChannelInfo("left_knee.state", "", "left_knee", "state", {"3": "FAULT"})
    description = station.robot.description
    assert description is not None
    station.take([Described(replace(description, channels=[state]))])
    _feed(station, {"left_knee.state": [3.0], "left_knee.error_code": [0x8611]})
    monkeypatch.setattr("time.monotonic_ns", lambda: 1_000_000)
    assert "■ fault 0x8611" in screen(station)


@pytest.mark.parametrize("chosen", [0, 7, 29])
def test_of_many_parameters_the_chosen_one_is_in_sight(chosen: int) -> None:
    station = a_station()
    names = [f"gait.number_{number}" for number in range(30)]
    description = station.robot.description
    assert description is not None
    known = [parameter(name, 0.0, 1.0) for name in names]
    station.take([Described(replace(description, parameters=known))])
    station.robot.parameters = {name: ParameterValue(0.25, "m", 0.0, 1.0, 0) for name in names}
    controls = Controls(station)
    for _ in range(chosen):
        controls.press(Key.DOWN)
    for size in ((118, 27), (80, 24)):
        text = " ".join(screen(station, controls, size).split())
        assert f"▶ gait.number_{chosen} 250 mm" in text
        assert f"Parameters {chosen + 1} of 30" in text


def test_old_values_say_how_old_they_are(monkeypatch: pytest.MonkeyPatch) -> None:
    station = a_station()
    _feed(station, {"left_knee.position": [0.5]})
    monkeypatch.setattr("time.monotonic_ns", lambda: 3_000_000_000)
    text = screen(station)
    assert "Joints 3.0 s old" in text
    assert "▲ stale" in text


def test_missing_value_is_a_dash_and_lost_is_named_with_its_reason() -> None:
    station = a_station()
    lost: QualityInfo = {"state": "lost", "age_ms": 2500.0, "problem": "no heartbeat from node 2"}
    station.take([Looked(Snapshot(0, {}, {}, {"left_knee": lost}), None, 0)])
    _feed(station, {"left_knee.position": [None]})
    text = screen(station)
    assert "✕ lost 2.5 s" in text
    assert "lost: left knee: no heartbeat from node 2" in text


def test_dropped_link_is_said_before_anything_else() -> None:
    station = a_station()
    station.take([LinkChanged(ConnectionState.WAITING, "no gateway at 127.0.0.1:7420", 0)])
    text = screen(station)
    assert "✕ waiting" in text
    assert "no gateway at 127.0.0.1:7420" in text


def test_write_is_shown_as_read_back() -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.RIGHT)
    assert "writing gait.step_length = 420 mm" in screen(station, controls)
    asked.answer(Written(1, {"gait.step_length": 0.4}, {"gait.step_length": 0.42}))
    assert "✓ 1 parameter written and read back" in screen(station, controls)


def test_write_whose_answer_was_lost_is_not_known() -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.RIGHT)
    asked.fail(LinkLost("the link dropped"))
    assert "✕ NOT KNOWN: the link dropped" in screen(station, controls)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (lambda _stopped: None, "STOP sent"),
        (
            lambda stopped: stopped.set_result(Stopped({"left_knee": "confirmed"}, True)),
            "STOP confirmed by the drive",
        ),
        (
            lambda stopped: stopped.set_result(Stopped({"left_knee": "unreachable"}, True)),
            "STOP NOT CONFIRMED: left knee unreachable",
        ),
        (lambda stopped: stopped.set_result(Stopped({}, True)), "STOP NOT CONFIRMED: no drive answered"),
        (
            lambda stopped: stopped.set_exception(LinkLost("there is no link")),
            "STOP NOT CONFIRMED: there is no link",
        ),
    ],
)
def test_stop_is_confirmed_only_by_every_drive(
    answer: Callable[["Future[Stopped]"], None], words: str
) -> None:
    asked = FakeCommands()
    station = a_station(asked)
    controls = Controls(station)
    controls.press(Key.STOP)
    answer(asked.futures[-1])
    assert words in screen(station, controls)


def test_empty_robot_can_be_drawn() -> None:
    station = a_station()
    station.robot = Robot()
    assert "not known yet" in screen(station)


def test_headless_line_has_a_dash_for_what_is_missing() -> None:
    station = a_station()
    _feed(station, {"left_knee.position": [None], "left_insole.force": [300.4]})
    line = headless.line(station.robot, Gait(), 7.0)
    assert "joints – °" in line
    assert "feet 300 N" in line
    assert "– steps/min" in line


@pytest.mark.parametrize(
    ("size", "words"), [((118, 27), "74 steps/min, stance 61 / 58 %"), ((80, 24), "74 steps/min")]
)
def test_dashboard_shows_how_the_wearer_walks(
    monkeypatch: pytest.MonkeyPatch, size: tuple[int, int], words: str
) -> None:
    legs = {Leg.LEFT: LegGait(stance=0.612), Leg.RIGHT: LegGait(stance=0.58)}
    station = a_station()
    assert "steps/min" not in screen(station, size=size)
    walks = Derived(gait=Gait(True, 74.2, legs=legs))
    monkeypatch.setattr(station.processing, "derived", lambda: walks)
    assert words in screen(station, size=size)


def _feed(station: Station, columns: dict[str, list[float | None]]) -> None:
    station.take([Telemetry(1, Batch([0], columns, 0, 0, 0, 1, 0), None)])
