"""Whatever somebody has named or said looks like what it is, in a terminal and for machines."""

import io
import json
import logging

import pytest
from rich.console import Console

from gateway.cli.text import say, say_json, table, warn
from gateway.client import Robot
from gateway.client.errors import RemoteError
from gateway.plain_text import json_plain, plain
from gateway.wire.resource import CpuUse, GatewayUse, MemoryUse, ProcessUse, ResourceSnapshot
from server_gui.cli.collect import PlainLines
from server_gui.core.desk.station import Station
from server_gui.core.follow.events import Failed, Resources
from server_gui.core.follow.news import News
from server_gui.terminal.controls import Controls
from server_gui.terminal.panels import WIDE, footer, header, resources
from tests.fake_robot import FakeRobot, Refusal
from tests.support.desk import FakeCommands

BAD = "zz[/b]\x1b[2J\x9b31m\r\n\u202egnp.exe\x07"
SHOWN = "zz[/b]\\x1b[2J\\x9b31m\\r\\n\\u202egnp.exe\\x07"


def harmless(text: str) -> bool:
    return all(letter.isprintable() or letter == "\n" for letter in text)


def test_letters_that_command_a_terminal_are_shown_as_what_they_are() -> None:
    assert plain(BAD) == SHOWN
    assert plain("λ · 5 °C – ok") == "λ · 5 °C – ok"
    assert plain("a\nb\tc", "\n") == "a\nb\\tc"


def test_json_says_the_same_and_commands_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    said = {"name": BAD + "\U000e0001"}
    say_json(said)
    out = capsys.readouterr().out
    assert harmless(out)
    assert json.loads(out) == said
    assert json_plain('{"a":1}') == '{"a":1}'


def test_commands_print_names_and_reasons_as_what_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    say(table(("NAME", BAD), [(BAD, "1"), ("b", "2")]))
    out = capsys.readouterr().out
    assert harmless(out)
    assert len(out.splitlines()) == 3  # no name makes a line
    assert SHOWN in out
    say(f"{BAD}\n")
    warn("stop", BAD)
    told = capsys.readouterr()
    assert harmless(told.out + told.err)
    assert "\n  \\u202egnp" in told.err


def test_the_log_has_one_line_a_record() -> None:
    record = logging.LogRecord("x", logging.WARNING, "f", 1, "%s", (BAD,), None)
    assert PlainLines("%(levelname)s %(message)s").format(record) == f"WARNING {SHOWN}"


def test_what_a_robot_refuses_with_commands_no_terminal() -> None:
    def refuse(params: object) -> object:
        raise Refusal(-32000, BAD + "x" * 10_000)

    with FakeRobot() as fake:
        fake.overrides["robot.describe"] = refuse
        with Robot(fake.address) as robot, pytest.raises(RemoteError) as raised:
            robot.describe()
    assert str(raised.value).startswith(SHOWN)
    assert len(str(raised.value)) < 5000


def test_the_terminal_shows_a_process_and_a_problem_as_what_they_are() -> None:
    station = Station("exo-01", BAD, FakeCommands(), lambda call: call(), News())
    processes = [ProcessUse(1, BAD, 1.0, 1), ProcessUse(2, "[red]a", 1.0, 1)]
    usage = (CpuUse(1.0, [1.0], [0.1]), MemoryUse(4, 2, 2, 0), GatewayUse(1.0, 1))
    looks = [ResourceSnapshot(1, *usage), ResourceSnapshot(1, *usage, processes)]
    station.take([*(Resources(look, None, 1) for look in looks), Failed("a look", BAD)])
    console = Console(file=io.StringIO(), width=140, color_system=None)
    for part in (
        header(station, BAD, WIDE),
        resources(station, WIDE),
        footer(station, Controls(station), BAD),
    ):
        console.print(part)
    shown = console.file.getvalue()  # type: ignore[attr-defined]
    assert harmless(shown)
    assert SHOWN in shown
    assert "[red]a" in shown
