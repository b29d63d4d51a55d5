"""A part of GWRMS alone: every help is there, and what is missing is named with the extra that brings it."""

import subprocess
import sys

import pytest

from gateway import main, missing_extras
from tests.support.extras import EXTRAS, ROOT, brought, distributions, imported, names, own
from tools.draw.commands import commands

# In a process of its own: what is imported once cannot be missing any more.
ASKED = """
import contextlib, io, sys
class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {missing}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Missing())
from gateway.main import COMMANDS, main
for words in {words}:
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        try:
            status = main([*words, "--help"])
        except SystemExit as ended:
            status = ended.code
    if status or "usage: gwrms " + words[0] not in said.getvalue():
        print(*words, status, said.getvalue())
"""


def test_help_needs_no_extra() -> None:
    absent = imported(set().union(*map(own, EXTRAS)))
    assert {"rich", "numpy", "PySide6", "obstore"} <= absent
    words = [[name] for name in main.COMMANDS] + [list(one.words) for one in commands()]
    script = ASKED.format(missing=absent, words=words)
    asked = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert (asked.returncode, asked.stdout, asked.stderr) == (0, "", "")


@pytest.mark.parametrize("extra", EXTRAS)
def test_what_is_missing_is_named_with_an_extra_that_brings_it(extra: str) -> None:
    for name in imported(own(extra)):
        assert own(missing_extras.extra_of(name)) & names(distributions()[name]), name
        assert f"pip install 'gwrms[{missing_extras.extra_of(name)}]'" in missing_extras.explained(name)


@pytest.mark.parametrize("command", ["demo", "top"])
def test_a_command_that_needs_less_says_so(command: str) -> None:
    assert missing_extras.extra_of("numpy", "collect") == "collect"
    assert missing_extras.extra_of("numpy", command) == missing_extras.extra_of("rich", command) == "sim"
    assert {"numpy", "rich"} <= brought("sim")


@pytest.mark.parametrize(("command", "extra"), [("gui", "server"), ("query", "query")])
def test_a_command_names_at_once_all_that_it_needs(command: str, extra: str) -> None:
    assert {missing_extras.extra_of(name, command) for name in ("numpy", "rich", "pyarrow")} == {extra}
    assert {"numpy", "rich", "pyarrow"} <= brought(extra)


def test_every_help_calls_it_exit_status() -> None:
    assert [one.words for one in commands() if "exit code" in one.parser.format_help().lower()] == []


def test_help_that_was_written_down_is_what_the_parser_says() -> None:
    for one in commands():
        said = one.parser.format_help().replace("\n\nresource:", "")  # whose title alone is not written down
        assert missing_extras.help_of([*one.words, "--help"]) == said


def test_nothing_but_help_is_answered_from_what_was_written_down() -> None:
    assert missing_extras.help_of(["sessions", "ls"]) is None
    assert missing_extras.help_of(["gatway", "--help"]) is None


def test_a_command_that_is_misspelled_is_guessed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["gatway"]) == 2
    assert "did you mean gateway" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "offered"),
    [
        ("gwrms se", {"set", "sensor", "sessions"}),
        ("gwrms cloud v", {"verify", "vacuum"}),
        ("gwrms sim r", {"run"}),
        ("gwrms set --tr", {"--trial"}),
        ("gwrms completion ", {"bash", "zsh", "fish"}),
    ],
)
def test_bash_completes(line: str, offered: set[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main.main(["completion", "bash"]) == 0
    words = line.split(" ")
    asked = f"""{capsys.readouterr().out}
COMP_WORDS=({" ".join(f'"{word}"' for word in words)}); COMP_CWORD={len(words) - 1}
"$(complete -p gwrms | sed 's/.*-F \\([^ ]*\\).*/\\1/')"; printf '%s\\n' "${{COMPREPLY[@]}}"
"""
    said = subprocess.run(["bash"], input=asked, capture_output=True, text=True, check=True).stdout
    assert set(said.split()) == offered
