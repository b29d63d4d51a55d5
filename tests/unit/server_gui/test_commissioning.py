"""Commissioning as the window knows it: whatever the command does, and does not, nothing is shown as good."""

import dataclasses
from collections.abc import Callable

import pytest

from server_gui.core.commissioning.alarm import unstopped
from server_gui.core.commissioning.commissioning import (
    GUARD_S,
    KILL_S,
    OLD_S,
    SILENT_S,
    STOP_S,
    STOPPER_S,
)
from server_gui.core.commissioning.messages import understood
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.core.commissioning.stages import LOOKS, Stage
from tests.support import commissioning as playing
from tests.support.commissioning import BEND, FILE, MOVES, WISH, Played, asks, lives, stopped, written


@pytest.fixture
def played() -> Played:
    return Played()


def stage(played: Played) -> Stage:
    return played.model.stage


def readings(played: Played) -> list[str]:
    return [one.text for one in played.model.live]


STATES: dict[Callable[[Played], None], Stage] = {
    playing.not_started: Stage.NOT_STARTED,
    playing.starting: Stage.STARTING,
    playing.working: Stage.WORKING,
    playing.silent: Stage.WORKING,
    playing.typing: Stage.HAND,
    playing.hand: Stage.HAND,
    playing.powered: Stage.HAND,
    playing.moving: Stage.MOVING,
    playing.died_moving: Stage.STOPPING,
    playing.bus_gone: Stage.BUS_GONE,
    playing.stopping: Stage.STOPPING,
    playing.stop_confirmed: Stage.STOPPED,
    playing.stop_not_confirmed: Stage.NOT_CONFIRMED,
    playing.ending: Stage.ENDING,
    playing.left: Stage.LEFT,
    playing.proposed: Stage.ASKING,
    playing.was_written: Stage.WRITTEN,
    playing.not_usable: Stage.UNUSABLE,
    playing.failed: Stage.FAILED,
    playing.died: Stage.DIED,
}


@pytest.mark.parametrize("state", playing.EVERY, ids=lambda state: state.__name__)
def test_each_state_is_what_has_happened(played: Played, state: Callable[[Played], None]) -> None:
    state(played)
    assert stage(played) is STATES[state]


def test_only_what_is_proved_is_shown_as_good() -> None:
    good = {stage for stage, look in LOOKS.items() if look.mark.colour == "good"}
    assert good == {Stage.WRITTEN}
    assert set(LOOKS) == set(Stage) == set(STATES.values())


def test_an_answer_goes_to_its_question_once_and_not_too_early(played: Played) -> None:
    played.start()
    played.talker.says(BEND)
    played.model.look()
    assert not played.model.answer("moved"), "a click on the question before"
    played.now_s += 2 * GUARD_S
    assert played.model.answer("moved")
    assert not played.model.answer("moved"), "a second click"
    assert played.talker.told == ['{"answer":"moved","number":13}']
    assert stage(played) is Stage.WORKING


def test_a_line_that_comes_twice_asks_once(played: Played) -> None:
    played.start()
    played.hear(BEND, BEND)
    assert sum("Bend the left knee" in line for line in played.model.log) == 1


def test_live_values_of_another_question_and_old_ones_are_not_live(played: Played) -> None:
    played.start()
    played.hear(BEND, lives(12, ("node 7", 1, "counts")))
    assert not readings(played)
    played.hear(MOVES)
    assert "61234 counts moved" in readings(played)
    played.now_s += OLD_S
    assert not readings(played)


def test_what_nobody_tells_is_a_dash(played: Played) -> None:
    played.start()
    played.hear(asks("Hold it", 1), lives(1, ("node 7", None, "counts")))
    assert readings(played) == ["— counts"]


def test_a_drive_that_answers_again_is_no_trouble_any_more(played: Played) -> None:
    playing.bus_gone(played)
    assert "no answer" in played.model.problem
    played.hear(MOVES)
    assert (played.model.stage, played.model.problem) == (Stage.HAND, "")


@pytest.mark.parametrize(
    "line", ["", "{", "Traceback (most recent call last):", "[1]", '{"ask": 7}', '{"live": 3}']
)
def test_what_is_not_understood_is_shown_and_asks_nothing(played: Played, line: str) -> None:
    played.start()
    played.hear(line)
    assert played.model.question is None
    assert played.model.log[-1].strip() == line.strip()


def test_a_newer_command_may_say_more() -> None:
    assert understood('{"ask": "How far?", "number": 2, "colour": "red"}').question == "How far?"
    assert understood('{"news": 1}').say is None
    assert understood(r'{"ask": "Bend it. Then press Enter.", "number": 2}').question == "Bend it."


def test_a_stop_that_the_command_does_not_hear_is_done_by_another_one(played: Played) -> None:
    playing.hand(played)
    first = played.talker
    played.model.stop()
    played.model.look()
    assert first.told == ['{"stop": true}']
    played.now_s += STOP_S + 0.1
    played.model.look()
    assert first.killed
    first.ends(-9)
    played.model.look()
    assert played.talker is not first
    assert "--stop" in played.talker.arguments
    assert stage(played) is Stage.STOPPING
    played.hear(stopped())
    played.end(0)
    assert stage(played) is Stage.STOPPED


def test_a_stop_after_the_command_died_asks_the_drives_that_were_found(played: Played) -> None:
    playing.died(played)
    assert played.model.can_stop
    played.model.stop()
    played.model.look()
    assert "--stop" in played.talker.arguments
    played.end(1, "can0: there is no such interface")
    assert stage(played) is Stage.NOT_CONFIRMED
    assert "no such interface" in played.model.problem


def test_a_command_that_ends_without_a_word_about_the_stop_has_not_confirmed_it(played: Played) -> None:
    playing.stopping(played)
    played.end(1)
    assert stage(played) is Stage.STOPPING
    assert "--stop" in played.talker.arguments


def test_after_a_stop_it_can_be_gone_on_with(played: Played) -> None:
    playing.stop_confirmed(played)
    assert played.model.can_start
    played.start()
    assert stage(played) is Stage.STARTING
    assert len(played.talkers) == 2


def test_it_does_not_run_twice(played: Played) -> None:
    playing.hand(played)
    played.start()
    assert len(played.talkers) == 1


def test_the_file_is_told_with_what_the_check_says(played: Played) -> None:
    playing.proposed(played)
    assert played.model.proposed == (WISH.file, FILE)
    assert played.model.written is None
    played.model.answer("y")
    played.hear(written(("warning", "no heartbeat"), unfinished=["left_hip"]))
    played.end(1)
    assert stage(played) is Stage.WRITTEN
    assert played.model.written is not None
    assert played.model.written.findings == (("warning", "no heartbeat"),)


def test_a_joint_that_is_under_power_is_told_until_it_no_longer_is(played: Played) -> None:
    playing.moving(played)
    assert "+3.5°" in played.model.problem
    assert not played.model.answer("")
    played.hear({"moving": None})
    assert (played.model.stage, played.model.problem) == (Stage.WORKING, "")


def test_silence_while_a_joint_is_under_power_is_told_soon(played: Played) -> None:
    playing.moving(played)
    assert not played.model.is_silent
    played.now_s += 2.0
    assert played.model.is_silent


def test_a_drive_that_was_homed_and_not_confirmed_off_is_not_called_good(played: Played) -> None:
    playing.moving(played)
    played.hear(stopped(confirmed=False))
    played.end(1, "NOT STOPPED: left knee")
    assert stage(played) is Stage.NOT_CONFIRMED


def test_a_command_that_dies_while_a_joint_is_under_power_is_followed_by_a_stop(played: Played) -> None:
    playing.died_moving(played)
    assert "--stop" in played.talker.arguments
    played.hear(stopped())
    played.end(0)
    assert stage(played) is Stage.STOPPED


def test_work_that_says_nothing_for_long_is_told(played: Played) -> None:
    playing.working(played)
    assert not played.model.is_silent
    played.now_s += SILENT_S
    assert played.model.is_silent


def test_a_command_that_does_not_start_says_why(played: Played) -> None:
    played.start()
    played.end(None, "ssh: No such file or directory")
    assert (played.model.stage, played.model.problem) == (Stage.FAILED, "ssh: No such file or directory")


def test_a_connection_that_is_gone_is_a_death_and_one_that_never_was_a_failure(played: Played) -> None:
    there = CommissioningRequest("exo.toml", "can0", computer="ada@exo-01")
    played.start(there)
    played.end(255, "Permission denied")
    assert stage(played) is Stage.FAILED
    played.start(there)
    played.hear(playing.steps(), BEND)
    played.end(255, "closed by remote host")
    assert stage(played) is Stage.DIED


@pytest.mark.parametrize(
    ("wish", "words"),
    [
        (CommissioningRequest("", "can0"), "name the robot's file"),
        (CommissioningRequest("exo", "can0"), "ends with .toml"),
        (CommissioningRequest("exo.toml", " "), "name its CAN bus"),
        (CommissioningRequest("exo.toml", "can0", bitrate="fast"), "the bit rate is a number"),
        (CommissioningRequest("exo.toml", "can0", computer="-oProxyCommand=x"), "a computer is named"),
    ],
)
def test_what_is_missing_is_said_before_anything_starts(
    played: Played, wish: CommissioningRequest, words: str
) -> None:
    with pytest.raises(ValueError, match=words):
        played.start(wish)
    assert played.talkers == []


def test_the_command_is_told_all_of_the_wish() -> None:
    wish = CommissioningRequest("exo.toml", "can0", "500000", ("a b", "c"), ("/dev/x",), "Ada")
    assert wish.arguments("--json") == [
        *("commission", "--json", "--bitrate=500000", "--eds=a b", "--eds=c", "--serial=/dev/x", "--who=Ada"),
        *("--", "exo.toml", "can0"),
    ]
    assert wish.typed.startswith("gwrms commission --bitrate=500000 '--eds=a b'")


def test_one_that_is_killed_while_it_lets_go_of_a_joint_under_power_is_followed_by_a_stop(
    played: Played,
) -> None:
    playing.moving(played)
    played.model.interrupt()
    played.model.look()
    played.end(-9)
    assert stage(played) is Stage.STOPPING
    assert "--stop" in played.talker.arguments


def test_what_was_confirmed_before_confirms_no_later_stop(played: Played) -> None:
    playing.stopping(played)
    played.hear(stopped())
    assert stage(played) is Stage.STOPPED
    hangs = played.talker
    played.model.stop()
    played.model.look()
    assert stage(played) is Stage.STOPPING
    played.now_s += STOP_S + 0.1
    played.model.look()
    hangs.ends(-9)
    played.model.look()
    assert "--stop" in played.talker.arguments


def test_a_command_that_cannot_be_killed_keeps_no_stop_waiting(played: Played) -> None:
    playing.stopping(played)
    played.now_s += STOP_S + KILL_S + 0.1
    played.model.look()
    assert "--stop" in played.talker.arguments


def test_a_stop_that_says_nothing_for_long_is_not_confirmed(played: Played) -> None:
    playing.died_moving(played)
    played.now_s += STOPPER_S + 0.1
    played.model.look()
    assert played.talker.killed
    played.end(-9)
    assert stage(played) is Stage.NOT_CONFIRMED


@pytest.mark.parametrize("state", [playing.stopping, playing.moving])
def test_a_window_that_is_closed_leaves_the_stop_that_it_owes(
    played: Played, state: Callable[[Played], None]
) -> None:
    state(played)
    first = played.talker
    assert not played.model.close(1.0)
    assert first.asked_to_end
    assert "--stop" in played.talker.arguments
    assert not played.talker.asked_to_end, "before it has begun that would end it"
    assert not played.model.close(1.0)
    assert len(played.talkers) == 2


def test_a_window_that_is_closed_owes_no_stop_where_nothing_moved(played: Played) -> None:
    playing.hand(played)
    played.model.close(1.0)
    assert len(played.talkers) == 1


def test_a_stop_that_was_not_confirmed_stays_named_when_another_robot_is_commissioned(played: Played) -> None:
    playing.stop_not_confirmed(played)
    (alarm,) = unstopped(played.model)
    assert (alarm.where, alarm.what) == (played.model.name, played.model.problem)
    played.model.start(dataclasses.replace(WISH, file="/home/ada/exo-02.toml"))
    assert stage(played) is Stage.STARTING
    assert unstopped(played.model) == [alarm]
    again = Played()
    playing.stop_not_confirmed(again)
    again.model.stop()
    again.model.look()
    again.hear(stopped())
    again.end(0)
    assert stage(again) is Stage.STOPPED
    assert unstopped(again.model) == []


def test_a_stop_of_one_computer_confirms_none_of_another(played: Played) -> None:
    """Their files have one name: the alarm of the first was gone with the second's STOP."""
    for computer, confirmed in (("ada@a", False), ("ada@b", True), ("", True)):
        played.start(CommissioningRequest("exo.toml", "can0", computer=computer))
        played.hear(asks("Hold it"))
        played.model.stop()
        played.hear(stopped(confirmed=confirmed))
        played.end(1)
        assert [one.subject for one in unstopped(played.model)] == ["commissioned ada@a:exo.toml"]
