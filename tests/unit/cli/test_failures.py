"""A program that asked for JSON reads on stdout why a command failed, whoever found that out."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from gateway.main import main

NOBODY = ("--robot", "127.0.0.1:9")


@pytest.mark.parametrize(
    ("argv", "kind", "words"),
    [
        (("stop", *NOBODY), "Failed", "NOT CONFIRMED, assume that the robot still moves. no gateway at"),
        (("describe", *NOBODY), "Unreachable", "no gateway at 127.0.0.1:9"),
        (("gatway",), "Usage", "there is no command 'gatway'; did you mean gateway?"),
        (("describe", "--rbot", "exo"), "Usage", "unrecognized arguments: --rbot exo"),
        (("journal",), "Usage", "usage: gwrms journal COMMAND"),
        (("journal", "verify", "nowhere"), "Usage", "there is no journal at nowhere"),
        (("eds", "nowhere.eds"), "Failed", "there is no EDS file 'nowhere.eds'"),
        (("sim", "run", "nowhere"), "Usage", "nowhere: there is no such file, and no scenario"),
    ],
)
def test_a_failure_is_one_object_and_is_said_on_stderr_too(
    capsys: pytest.CaptureFixture[str], argv: tuple[str, ...], kind: str, words: str
) -> None:
    try:
        status = main([*argv, "--json"])
    except SystemExit as ended:
        status = ended.code if isinstance(ended.code, int) else -1
    said = capsys.readouterr()
    assert status == (2 if kind == "Usage" else 1)
    error = json.loads(said.out)["error"]
    assert error["kind"] == kind
    assert error["message"].startswith(words)
    assert error["message"].splitlines()[0] in said.err


def test_an_answer_that_tells_the_failure_itself_is_all_there_is(
    capsys: pytest.CaptureFixture[str], tmp_path_factory: pytest.TempPathFactory
) -> None:
    (file := tmp_path_factory.mktemp("files") / "robot.toml").write_text("[robot\n")
    assert main(["check", str(file), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["ok"] is False


def test_what_was_done_and_help_have_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["describe", "--help", "--json"])
    assert not ended.value.code
    assert "error" not in capsys.readouterr().out


def test_the_streams_are_the_programs_own_again() -> None:
    before = sys.stdout, sys.stderr
    main(["gatway", "--json"])
    assert (sys.stdout, sys.stderr) == before


@pytest.mark.parametrize(
    "words", [["check", "--schema", "robot"], ["check", "--json", "none.toml"], ["--help"]]
)
def test_a_full_disk_is_told_in_words_without_a_traceback(words: list[str]) -> None:
    command = [sys.executable, "-P", "-m", "gateway.main", *words]
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (ended.returncode, "No space left on device" in ended.stderr) == (1, True)
    assert not any(words in ended.stderr for words in ("Traceback", "Errno", "Exception ignored"))


@pytest.mark.parametrize("words", [["top", "--help"], ["describe"], ["describe", "--json"]])
def test_a_package_that_every_command_needs_is_told_in_words(words: list[str]) -> None:
    without = "import sys; sys.modules['msgspec'] = None; from gateway.main import main; sys.exit(main())"
    command = [sys.executable, "-c", without, *words]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert ended.stderr == ("gwrms: msgspec is not installed, which every command needs: pip install gwrms\n")
