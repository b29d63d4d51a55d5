"""A command that is talked to: whatever it does, its end and its words are known."""

import sys
from collections.abc import Callable, Sequence

import pytest

from server_gui.processes import interactive_command
from server_gui.processes.interactive_command import InteractiveCommand
from tests.support.waiting import WAIT_S, until

ECHO = "import sys\nfor line in sys.stdin: print('heard', line.strip(), flush=True)"
DEAF = "import signal, time; signal.signal(15, signal.SIG_IGN); print('deaf', flush=True); time.sleep(600)"


def python(code: str) -> Sequence[str]:
    return [sys.executable, "-S", "-c", code]


def heard(one: InteractiveCommand, words: str) -> Callable[[], bool]:
    lines: list[str] = []

    def so() -> bool:
        lines.extend(one.heard())
        return any(words in line for line in lines)

    return so


def test_what_is_sent_is_heard_and_the_end_is_known() -> None:
    one = InteractiveCommand(python(ECHO))
    one.send("a")
    one.send("b")
    until(heard(one, "heard b"), "both were heard")
    one.end()
    assert one.join(WAIT_S)
    assert one.ended is not None
    assert one.ended.status == -15
    one.send("c")  # to nobody


def test_its_last_words_are_kept_and_lines_come_before_the_end() -> None:
    one = InteractiveCommand(python("import sys; print('no newline', end=''); sys.exit('can0 is not there')"))
    assert one.join(WAIT_S)
    assert one.ended is None, "there is a line that nobody has heard"
    assert one.heard() == ["no newline"]
    assert one.ended is not None
    assert (one.ended.status, one.ended.last_words) == (1, "can0 is not there")


def test_one_that_does_not_end_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interactive_command, "END_S", 0.2)
    one = InteractiveCommand(python(DEAF))
    until(heard(one, "deaf"), "it is deaf")
    one.end()
    assert one.join(WAIT_S)
    assert one.ended is not None
    assert one.ended.status == -9


def test_one_that_is_not_there_says_so() -> None:
    one = InteractiveCommand(["/nowhere/ssh"])
    assert one.join(WAIT_S)
    assert one.ended is not None
    assert one.ended.status in (None, 127)
    assert "No such file or directory" in one.ended.last_words


def test_a_line_without_end_does_not_fill_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interactive_command, "LONGEST", 1000)
    one = InteractiveCommand(python("print('x' * 200_000); print('after')"))
    assert one.join(WAIT_S)
    found = one.heard()
    assert found[-1] == "after"
    assert sum(map(len, found)) < 200_000


def test_on_another_computer_what_is_typed_there_is_quoted(monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[Sequence[str]] = []
    monkeypatch.setattr(interactive_command, "InteractiveCommand", commands.append)
    interactive_command.talk(["commission", "--", "a b.toml", "can0; reboot"], "ada@exo-01")
    assert commands[0][-2:] == ["ada@exo-01", "gwrms commission -- 'a b.toml' 'can0; reboot'"]
    assert "BatchMode=yes" in commands[0]
