"""Commissioning by lines: late and doubled answers reach no other question, a stop is always heard."""

import json
import os
import signal
import threading
from collections.abc import Callable, Iterator

import pytest

from drivers.errors import DeviceTimeout
from gateway.cli.commission_lines import JsonFace, Lines
from gateway.cli.motion_ends import ENDS, MotionEnded, ending
from gateway.commission.dialogue import Ask, DeviceReading, number, run
from tests.support.waiting import WAIT_S, until


class Pipe:
    """Somebody who writes."""

    def __init__(self) -> None:
        self.source, self._sink = os.pipe()

    def write(self, *lines: str) -> None:
        os.write(self._sink, "".join(f"{line}\n" for line in lines).encode())

    def end(self) -> None:
        if self._sink >= 0:
            os.close(self._sink)
        self._sink = -1


@pytest.fixture
def pipe() -> Iterator[Pipe]:
    made = Pipe()
    yield made
    made.end()
    os.close(made.source)


def told(capsys: pytest.CaptureFixture[str]) -> list[dict[str, object]]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_late_and_doubled_answers_are_passed_over(pipe: Pipe) -> None:
    pipe.write('{"answer": "1", "number": 1}', '{"answer": "1", "number": 1}', '{"answer": "2", "number": 2}')
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        assert [face.ask(Ask("first")), face.ask(Ask("second"))] == ["1", "2"]


def test_plain_lines_answer_in_their_order_and_the_last_needs_no_newline(pipe: Pipe) -> None:
    pipe.write("exo-01", "", '{"not": json')
    os.write(pipe._sink, b"last")
    pipe.end()
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        assert [face.ask(Ask("?")) for _ in range(4)] == ["exo-01", "", '{"not": json', "last"]
        for _ in range(2):
            with pytest.raises(EOFError):
                face.ask(Ask("?"))


def test_a_refusal_stands_at_the_question_that_comes_again(
    pipe: Pipe, capsys: pytest.CaptureFixture[str]
) -> None:
    pipe.write("12,5", "12.5")
    with Lines(pipe.source) as lines:
        assert run(number("How far?", "°", 0, 90), JsonFace(lines)) == 12.5
    first, said, again = told(capsys)
    assert (first["refused"], first["bounds"], first["unit"]) == ("", [0, 90], "°")
    assert again["refused"] == said["say"]
    assert (first["number"], again["number"]) == (1, 2)


def test_what_drives_tell_comes_until_the_answer_and_one_that_is_silent_is_told(
    pipe: Pipe, capsys: pytest.CaptureFixture[str]
) -> None:
    looks: list[int] = []

    def live() -> list[DeviceReading]:
        looks.append(1)
        if len(looks) == 2:
            raise DeviceTimeout("node 7 does not answer")
        if len(looks) == 3:
            pipe.write("moved")
        return [DeviceReading("node 7", None, "counts")]

    with Lines(pipe.source) as lines:
        assert JsonFace(lines).ask(Ask("Bend it", live=live)) == "moved"
    _, one, two, three, *_ = told(capsys)
    assert one["live"] == three["live"] == [{"name": "node 7", "value": None, "unit": "counts"}]
    assert (two["live"], two["problem"]) == ([], "node 7 does not answer")


def test_an_object_that_is_no_answer_is_not_taken_for_enter(pipe: Pipe) -> None:
    mistyped = ['{"anwser": "y"}', '{"number": 1}', '{"answer": 1}', '{"answer": "y", "nubmer": 1}']
    pipe.write(*mistyped)
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        assert [face.ask(Ask("?")) for _ in mistyped] == mistyped


@pytest.mark.parametrize(
    "line",
    [
        ' {"stop": true}\r',
        '{"STOP": true}',
        '{"stop": 1}',
        '{"stop": true, "x": 1}',
        '{"stop": true}{"stop": true}',
        '{"stop": tr',
        '{"answer": "y", "num{"stop": true}',
        "{'stop': True}",
        '\ufeff{"stop": true}',
        '[{"stop": true}]',
        '{"command": "stop"}',
        '"stop"',
        "STOP!",
    ],
)
def test_whatever_could_be_meant_as_a_stop_is_one(pipe: Pipe, line: str) -> None:
    with ending(), Lines(pipe.source) as lines, pytest.raises(MotionEnded):
        stopped_in(pipe, lines, lambda lines: JsonFace(lines).ask(Ask("?")), line)


def test_the_word_in_an_answer_is_no_stop(pipe: Pipe) -> None:
    pipe.write('{"answer": "stop"}', "stop watch", "non-stop", '{"stop": false}', "a/stop.toml")
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        said = [face.ask(Ask("?")) for _ in range(5)]
    assert said == ["stop", "stop watch", "non-stop", '{"stop": false}', "a/stop.toml"]


@pytest.mark.parametrize(
    "line", ["please stop", "stopp", '{"answer": "STOP it", "number": 1}', '{"stop": 0}']
)
def test_where_only_enter_is_asked_for_whatever_has_stop_in_it_is_one(pipe: Pipe, line: str) -> None:
    with ending(), Lines(pipe.source) as lines:
        with pytest.raises(MotionEnded):
            stopped_in(pipe, lines, lambda lines: JsonFace(lines).ask(Ask("Press Enter.", press=True)), line)
        assert lines.stop_asked


def test_a_line_that_nothing_can_read_takes_no_hearing(pipe: Pipe) -> None:
    """Thousands of brackets ended the thread that reads: a stop after them was not heard any more."""
    pipe.write("[" * 20_000)
    with ending(), Lines(pipe.source) as lines:
        assert JsonFace(lines).ask(Ask("?")).startswith("[[")
        with pytest.raises(MotionEnded):
            stopped_in(pipe, lines, lambda lines: JsonFace(lines).ask(Ask("?")))


@pytest.mark.parametrize("looks", [1, 2])
def test_a_stop_with_the_end_of_the_input_answers_no_question(pipe: Pipe, looks: int) -> None:
    """The line stood behind the end once it was looked at, and was taken for the next answer."""
    pipe.write("y")
    pipe.end()
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        until(lambda: lines._read.qsize() == 2)
        assert all(face.moving("under power") for _ in range(looks))
        with pytest.raises(EOFError):
            face.ask(Ask("Is its zero right?"))


def stopped_in(
    pipe: Pipe, lines: Lines, busy: Callable[[Lines], object], line: str = '{"stop": true}'
) -> None:
    pipe.write(line, line)
    busy(lines)


@pytest.mark.parametrize(
    "busy", [lambda lines: JsonFace(lines).ask(Ask("?")), lambda _: threading.Event().wait(WAIT_S)]
)
def test_a_stop_ends_whatever_is_done_and_once(pipe: Pipe, busy: Callable[[Lines], object]) -> None:
    with ending(), Lines(pipe.source) as lines:
        with pytest.raises(MotionEnded):
            stopped_in(pipe, lines, busy)
        assert lines.stop_asked


def test_a_stop_that_comes_just_before_a_question_waits_is_heard(
    pipe: Pipe, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The signal interrupted nothing, as the wait had not begun: the stop was lost until an answer came."""
    with ending(), Lines(pipe.source) as lines:
        wait = lines._read.get

        def uninterrupted(timeout: float | None = None) -> object:
            signal.pthread_sigmask(signal.SIG_BLOCK, ENDS)
            try:
                return wait(timeout)
            finally:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDS)

        monkeypatch.setattr(lines._read, "get", uninterrupted)
        late = threading.Timer(WAIT_S / 2, pipe.write, ("an answer",))
        late.start()
        with pytest.raises(MotionEnded):
            stopped_in(pipe, lines, lambda lines: JsonFace(lines).ask(Ask("?")))
        late.cancel()


def test_a_second_signal_does_not_end_what_the_first_one_ends() -> None:
    with ending():
        with pytest.raises(MotionEnded):
            signal.raise_signal(signal.SIGINT)
        for number in ENDS:
            signal.raise_signal(number)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_line_without_end_is_not_waited_for(pipe: Pipe, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.cli.commission_lines.LONGEST", 100)
    os.write(pipe._sink, b"x" * 200)
    with Lines(pipe.source) as lines, pytest.raises(EOFError):
        JsonFace(lines).ask(Ask("?"))


def test_any_line_while_a_joint_moves_is_a_stop_and_no_answer(
    pipe: Pipe, capsys: pytest.CaptureFixture[str]
) -> None:
    with Lines(pipe.source) as lines:
        face = JsonFace(lines)
        assert face.moving("under power") == ""
        pipe.write('{"answer": "late", "number": 7}')
        assert until(lambda: face.moving("under power")) == "STOP was pressed"
        pipe.end()
        face.say("over")
        assert (
            until(lambda: face.moving("under power")) == "nobody can press STOP any more: its input has ended"
        )
        with pytest.raises(EOFError):
            face.ask(Ask("?"))
    assert [line for line in told(capsys) if "moving" in line][:2] == [
        {"moving": "under power"},
        {"moving": None},
    ]
