"""While a joint moves, whatever is typed is a STOP, and so is that nobody can type any more."""

import os
import pty
from collections.abc import Iterator

import pytest

from gateway.cli.commission_faces import Terminal
from gateway.cli.line_input import Typed, looks_like_stop
from gateway.cli.motion_ends import MotionEnded, ending
from gateway.commission.dialogue import Ask


@pytest.fixture
def pipe() -> Iterator[tuple[Typed, int]]:
    read, write = os.pipe()
    yield Typed(read), write
    os.close(read)


def test_lines_come_one_by_one_and_end(pipe: tuple[Typed, int]) -> None:
    typed, write = pipe
    os.write(write, b"left_knee\n\nlast")
    os.close(write)
    assert [typed.line(), typed.line(), typed.line()] == ["left_knee\n", "\n", "last"]
    with pytest.raises(EOFError):
        typed.line()


def test_what_was_typed_ahead_is_a_stop_although_it_was_read_already(pipe: tuple[Typed, int]) -> None:
    typed, write = pipe
    os.write(write, b"home left_knee\n\n")
    assert typed.line() == "home left_knee\n"
    assert typed.waits(0.0) == "STOP was pressed"
    typed.drop()
    assert typed.waits(0.0) == ""
    os.write(write, b"x")  # without Enter, from a face that is no terminal
    assert typed.waits(1.0) == "STOP was pressed"
    os.close(write)


def test_an_input_that_ends_is_a_stop(pipe: tuple[Typed, int]) -> None:
    typed, write = pipe
    assert typed.waits(0.0) == ""
    os.close(write)
    assert "nobody can press STOP any more" in typed.waits(1.0)
    typed.drop()
    assert "nobody can press STOP any more" in typed.waits(0.0)


def test_a_terminal_that_is_closed_is_a_stop() -> None:
    master, slave = pty.openpty()
    typed = Typed(slave)
    assert typed.waits(0.0) == ""
    os.close(master)
    assert "nobody can press STOP any more" in typed.waits(1.0)
    os.close(slave)


def test_a_terminal_says_that_it_moves_and_looks_at_the_keys(
    pipe: tuple[Typed, int], capsys: pytest.CaptureFixture[str]
) -> None:
    face, write = Terminal(), pipe[1]
    face.typed = pipe[0]
    os.write(write, b"\n")
    assert face.moving("STOP: Enter") == "STOP was pressed"
    assert "STOP: Enter" in capsys.readouterr().out
    os.close(write)


@pytest.mark.parametrize(
    ("text", "is_stop", "is_stop_for_enter"),
    [
        ("STOP", True, True),
        ("STOP STOP", True, True),
        ("stop! stop!!", True, True),
        ("please stop", False, True),
        ("Stop it", False, True),
        ("stopp", False, True),
        ("stop_button", False, True),
        ("left_stop_button", False, True),
        ("", False, False),
        ("y", False, False),
        ("step", False, False),
    ],
)
def test_what_is_a_stop_depends_on_whether_anything_but_enter_can_be_meant(
    text: str, is_stop: bool, is_stop_for_enter: bool
) -> None:
    assert looks_like_stop(text) is is_stop
    assert looks_like_stop(text, press=True) is is_stop_for_enter


def test_a_name_with_stop_in_it_is_an_answer(pipe: tuple[Typed, int]) -> None:
    terminal = Terminal()
    terminal.typed, write = pipe
    os.write(write, b"stop_button\nplease stop\n")
    os.close(write)
    with ending():
        assert [terminal.ask(Ask("What is it called?")) for _ in range(2)] == [
            "stop_button\n",
            "please stop\n",
        ]
    assert not terminal.stop_asked


@pytest.mark.parametrize("line", ["stop\n", " STOP!\n", '{"stop"\n', "STOP STOP\n", "please stop\n"])
def test_at_a_question_stop_is_no_enter(line: str, pipe: tuple[Typed, int]) -> None:
    """*Then press Enter* took it for one, and the next joint was powered."""
    terminal = Terminal()
    terminal.typed, write = pipe
    os.write(write, line.encode())
    os.close(write)
    with ending(), pytest.raises(MotionEnded):
        terminal.ask(Ask("Hold the leg. Then press Enter.", press=True))
    assert terminal.stop_asked
