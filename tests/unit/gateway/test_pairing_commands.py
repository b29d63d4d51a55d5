"""`gwrms keys pair` and `gwrms pair`: what is typed where, and what a terminal shows."""

import io
import queue
import signal
import threading
from argparse import Namespace
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import msgspec
import pytest

from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.access.pairing import Candidate, PairingEnded
from gateway.certificates import grouped
from gateway.cli import qr_code
from gateway.cli.keys import _confirmed as confirmed
from gateway.cli.keys import _show as show
from gateway.client import Address, NotPaired
from gateway.client.keys import pin_of
from gateway.client.pairing import pair, typed
from gateway.connections.listeners import listen
from gateway.main import main
from gateway.wire.pairing import Reply, link, normal
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S
from tests.unit.gateway import processes
from tests.unit.gateway.pairing_robot import CODE, Shown


@pytest.fixture
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shown]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    made = Shown(tmp_path)
    yield made
    made.close()


class Typing(io.TextIOWrapper):
    """A standard input with these lines in it."""

    def __init__(self, lines: str, *, is_terminal: bool) -> None:
        super().__init__(io.BytesIO(lines.encode(errors="surrogateescape")))
        self._is_terminal = is_terminal

    def isatty(self) -> bool:
        return self._is_terminal


def types(monkeypatch: pytest.MonkeyPatch, lines: str, *, is_terminal: bool = False) -> None:
    monkeypatch.setattr("sys.stdin", Typing(lines, is_terminal=is_terminal))


def asked_for(shown: Shown, *arguments: str) -> int:
    """`gwrms pair` with these, and a person on the robot who confirms it."""
    waiting = shown.wait()
    with ThreadPoolExecutor(1) as pool:
        command = pool.submit(main, ["pair", *arguments])
        shown.take(waiting)
        return command.result()


def test_the_code_is_a_line_of_the_input_and_no_argument(
    shown: Shown, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types(monkeypatch, f"{CODE.lower()}\nmore")
    assert asked_for(shown, str(shown.where), "--json") == 0
    captured = capsys.readouterr()
    assert msgspec.json.decode(captured.out)["robot"] == "exo-01"
    assert captured.err == "", "nobody is there to be asked"


def test_a_wrong_code_is_refused_and_nobody_is_waited_for(
    shown: Shown, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types(monkeypatch, "FFFF-FFFF-FFFF-FFFF\n")
    shown.wait()
    assert main(["pair", str(shown.where)]) == 1
    captured = capsys.readouterr()
    assert "that is not the code" in captured.err
    assert "Waiting until" not in captured.out


def test_whoever_has_typed_the_right_code_is_told_who_is_waited_for(
    shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: queue.Queue[str] = queue.Queue()
    monkeypatch.setattr("gateway.cli.pair._REFUSED_S", 0.0)
    monkeypatch.setattr("gateway.cli.pair.say", lines.put)
    types(monkeypatch, f"{CODE}\n")
    waiting = shown.wait()
    with ThreadPoolExecutor(1) as pool:
        command = pool.submit(main, ["pair", str(shown.where)])
        assert lines.get(timeout=WAIT_S).startswith("Waiting until somebody confirms it on the robot")
        shown.take(waiting)
        assert command.result() == 0
    assert "Waiting" not in "".join(lines.get_nowait() for _ in range(lines.qsize())), "it is said once"


def test_a_person_who_mistypes_the_code_is_asked_again(
    shown: Shown, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types(monkeypatch, f"0123-4567\n{CODE}\n", is_terminal=True)
    assert asked_for(shown, str(shown.where)) == 0
    captured = capsys.readouterr()
    assert captured.out.count("The code that the robot shows: ") == 2
    assert "gwrms pair: a code has 16 letters and digits" in captured.err
    assert CODE not in captured.out + captured.err


@pytest.mark.parametrize("is_terminal", [False, True])
def test_who_types_nothing_is_not_waited_for(
    is_terminal: bool, shown: Shown, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types(monkeypatch, "0123\n" if is_terminal else "", is_terminal=is_terminal)
    assert main(["pair", str(shown.where)]) == 1
    assert "nothing was typed" in capsys.readouterr().err


def test_nobody_is_asked_for_a_code_where_no_robot_pairs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with listen("127.0.0.1", 0) as listener:
        where = Address("127.0.0.1", listener.getsockname()[1])
    types(monkeypatch, f"{CODE}\n", is_terminal=True)
    assert main(["pair", str(where)]) != 0
    captured = capsys.readouterr()
    assert f"no robot pairs at {where}" in captured.err
    assert "code" not in captured.out


@pytest.mark.parametrize("lines", ["0123\n", "\n", "\N{BLACK HEART SUIT}" * 16 + "\n"])
def test_what_is_no_code_in_a_pipe_ends_it(
    lines: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    types(monkeypatch, lines)
    with pytest.raises(SystemExit, match="2"):
        main(["pair", "192.0.2.7"])
    assert "16 letters and digits" in capsys.readouterr().err


SPELLED = (CODE, CODE.lower(), CODE.replace("-", " "), CODE.replace("-", ""))


@pytest.mark.parametrize("code", SPELLED)
@pytest.mark.parametrize("words", ["{}", "gwrms:/exo:7421/{}", "exo:7421/{}", "http://exo:7421/{}"])
def test_a_code_in_the_place_of_an_address_is_said_and_not_shown(
    words: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for command in (["pair"], ["describe", "--robot"]):
        with pytest.raises(SystemExit) as caught:
            main([*command, words.format(code)])
        assert caught.value.code == 2
        said = capsys.readouterr()
        assert code not in said.out + said.err
        assert "no code is an address" in said.err


@pytest.mark.parametrize("scheme", ["gwrms://", "GWRMS://", " Gwrms://"])
def test_a_link_is_taken_in_capitals_too(scheme: str) -> None:
    assert typed(f"{scheme}EXO:7421/{CODE}") == (Address("EXO", 7421), normal(CODE))


@pytest.mark.parametrize("host", ["exo", "exoskeletonrobot", "exo-1234-left-leg0", "fe80::1", "a1.b2"])
def test_a_host_is_no_code(host: str) -> None:
    assert Address.parse(f"[{host}]:7420" if "::" in host else f"{host}:7420").host == host


@pytest.mark.parametrize("name", ["anna b", "\udcff", "x" * 9000, "a\N{RIGHT-TO-LEFT OVERRIDE}b"])
def test_a_name_that_no_desk_can_have_is_not_sent(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["pair", "192.0.2.7", CODE, "--name", name])
    assert "is no name" in capsys.readouterr().err


# What the person on the robot types


@pytest.fixture
def candidate(shown: Shown) -> Iterator[Candidate]:
    """A desk that has proved the code."""
    waiting = shown.wait()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(pair, shown.where, CODE)
        yield (found := waiting.result())
        found.answer(Reply(problem="enough"))


ASKING = Namespace(yes=False, name=None, role=None)


def test_who_mistypes_name_or_role_is_asked_again(
    shown: Shown, candidate: Candidate, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before, one letter too many sent the desk away, and nobody was told why."""
    changes.add(shown.folder, "anna", b"another one's", Role.VIEWER)
    types(monkeypatch, "anna\nbeñ\nben\noprator\noperator\n", is_terminal=True)
    assert confirmed(candidate, ASKING, shown.folder) == ("ben", Role.OPERATOR)
    said = capsys.readouterr().err
    assert all(
        words in said for words in ("anna is known already", "'beñ' is no name", "'oprator' is no role")
    )


@pytest.mark.parametrize("lines", ["ben\n\n", "ben\n", "", "\udcff\n"])
def test_who_says_nothing_lets_nobody_in(
    lines: str, shown: Shown, candidate: Candidate, monkeypatch: pytest.MonkeyPatch
) -> None:
    types(monkeypatch, lines, is_terminal=True)
    with pytest.raises(PairingEnded, match="nobody was paired"):
        confirmed(candidate, ASKING, shown.folder)


def test_a_desk_that_has_gone_while_the_person_thought_is_not_let_in(shown: Shown) -> None:
    """Its key was let in, the robot said so, and the desk knew nothing of it."""
    waiting, gone = shown.wait(), threading.Event()
    with ThreadPoolExecutor(1) as pool:
        desk = pool.submit(pair, shown.where, CODE, given_up=gone.is_set)
        candidate = waiting.result()
        candidate.check_waits()
        gone.set()
        assert isinstance(desk.exception(), NotPaired)
    with candidate.connection, pytest.raises(PairingEnded, match="the desk has gone meanwhile"):
        candidate.check_waits()


def test_a_name_that_is_taken_is_said_before_a_code_is_shown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nname = "exo-01"\n', encoding="utf-8")
    changes.add(AccessFolder(tmp_path, {}), "anna", b"another one's", Role.VIEWER)
    assert (
        main(["keys", "pair", str(file), "--port", "0", "--name", "anna", "--role", "viewer", "--yes"]) == 1
    )
    captured = capsys.readouterr()
    assert "anna is known already" in captured.err
    assert captured.out == ""


# From beginning to end


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_pairing_that_is_shown_and_ended_leaves_the_robot_without_keys(
    number: signal.Signals, tmp_path: Path
) -> None:
    """It locked whoever could stop the robot before out of it, without letting a desk in."""
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nname = "exo-01"\n', encoding="utf-8")
    options = ("--port", "0", "--name", "anna", "--role", "operator", "--yes")
    with processes.process(*processes.GATEWAY[:-1], "keys", "pair", str(file), *options) as robot:
        assert robot.stdout is not None
        assert robot.stderr is not None
        assert "only a desk on this computer" in robot.stderr.readline(), "before a code is shown"
        next(line for line in robot.stdout if line.startswith("  gwrms pair"))
        robot.send_signal(number)
        robot.wait()
    assert not AccessFolder(tmp_path, {}).has_keys


def test_two_commands_let_a_desk_in_and_a_third_sends_it_away(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nname = "exo-01"\n', encoding="utf-8")
    options = ("--port", "0", "--name", "anna", "--role", "operator", "--yes")
    with processes.process(*processes.GATEWAY[:-1], "keys", "pair", str(file), *options) as robot:
        assert robot.stdout is not None
        where = next(line for line in robot.stdout if line.startswith("  gwrms pair")).split()[-1]
        code = next(line for line in robot.stdout if line.startswith("  ")).strip()
        types(monkeypatch, f"{link(where, code)}\n")
        assert main(["pair"]) == 0
        assert "anna is let in from now on, as operator." in robot.stdout.read()
        assert robot.wait() == 0
    assert "Paired with exo-01: it calls this desk anna, as operator." in capsys.readouterr().out
    assert main(["keys", "list", str(file)]) == 0
    listed = capsys.readouterr().out
    assert f"robot  {grouped(pin_of(Address()) or '')}" in listed
    assert "anna  operator" in listed
    assert main(["keys", "revoke", str(file), "anna"]) == 0
    assert main(["keys", "revoke", str(file), "anna"]) == 1
    assert "there is no anna" in capsys.readouterr().err


def test_without_a_terminal_nobody_is_asked_and_nobody_let_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[robot]\nname = "exo-01"\n', encoding="utf-8")
    with pytest.raises(SystemExit):
        main(["keys", "pair", str(file), "--yes"])
    monkeypatch.setattr("sys.stdin", io.StringIO())
    assert main(["keys", "pair", str(file), "--port", "0"]) == 1
    assert "there is no terminal to ask on" in capsys.readouterr().err
    assert not (tmp_path / "keys").exists()


class Terminal(io.StringIO):
    """A terminal with some letters."""

    encoding = "utf-8"

    def isatty(self) -> bool:
        return True


def test_a_terminal_shows_the_link_for_a_camera_and_a_pipe_does_not(
    shown: Shown, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdout", terminal := Terminal())
    show(shown.listener, CODE, shown.own)
    lines = [line for line in terminal.getvalue().splitlines() if set(line) <= set(" █▀▄") and line]
    assert lines == qr_code.lines(link(str(shown.where), CODE))
    for letters, is_terminal in (("ascii", True), ("utf-8", False)):
        monkeypatch.setattr(Terminal, "encoding", letters)
        monkeypatch.setattr(Terminal, "isatty", lambda _self, is_terminal=is_terminal: is_terminal)
        monkeypatch.setattr("sys.stdout", terminal := Terminal())
        show(shown.listener, CODE, shown.own)
        assert f"\n  gwrms pair {shown.where}\n" in terminal.getvalue()
        assert f"\n  {CODE}\n" in terminal.getvalue()
        assert "█" not in terminal.getvalue()
