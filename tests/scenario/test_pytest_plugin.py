"""`pytest --gwrms DIR`: scenario files as tests beside others, with readable failures."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DEADLINE_S = 240.0
HOLDS = """\
title = "It stands"

[robot]
scenario = "stand"

[[expect]]
truth = "wearer.activity"
is = "stand"
at_s = 0.1
"""
FAILS = HOLDS.replace("It stands", "It sits").replace('is = "stand"', 'is = "sit"')
TEST = "def test_of_python() -> None:\n    pass\n"
# The computer was too slow, whatever it is.
ALWAYS_SLOW = """\
from hil_sim.scenario.lateness import Lateness

Lateness.doubt = lambda *_: "this computer was too slow"
"""
NEVER_SLOW = ALWAYS_SLOW.replace("this computer was too slow", "")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "pytest.ini").write_text("[pytest]\n", encoding="utf-8")
    (tmp_path / "test_x.py").write_text(TEST, encoding="utf-8")
    (tmp_path / "conftest.py").write_text(NEVER_SLOW, encoding="utf-8")
    (tmp_path / "scenarios").mkdir()
    put(tmp_path, "holds", HOLDS)
    return tmp_path


def put(folder: Path, name: str, text: str) -> None:
    (folder / "scenarios" / f"{name}.toml").write_text(text, encoding="utf-8")


def run(folder: Path, *arguments: str, status: int = 0) -> str:
    """As pytest loads an installed plugin, whether this environment has it installed or not."""
    command = [sys.executable, "-m", "pytest", "-p", "hil_sim.pytest_plugin", "-p", "no:cacheprovider", "-rA"]
    done = subprocess.run(
        [*command, *arguments],
        cwd=folder,
        env=os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=DEADLINE_S,
        check=False,
    )
    said = done.stdout + done.stderr
    assert done.returncode == status, said
    return said


def test_paths_that_are_named_are_tested_too(folder: Path) -> None:
    said = run(folder, "--gwrms", "scenarios/holds.toml", "test_x.py")
    assert "2 passed" in said


def test_without_the_option_files_are_left_alone(folder: Path) -> None:
    said = run(folder, ".")
    assert "1 passed" in said
    assert "holds" not in said


def test_each_file_is_a_test_and_what_fails_is_told_without_a_traceback(folder: Path) -> None:
    put(folder, "fails", FAILS)
    put(folder, "wrong", "colour = 1")
    said = run(folder, "--gwrms", "scenarios", "--continue-on-collection-errors", status=1)
    assert "PASSED scenarios/holds.toml::It stands" in said
    assert "FAILED scenarios/fails.toml::It sits" in said
    assert "true wearer.activity is 'sit' at 0.1 s" in said
    assert "wearer.activity was 'stand' at 0.10 s" in said
    assert "Traceback" not in said
    assert "[colour]: is not known" in said
    assert "1 failed, 1 passed, 1 error" in said


@pytest.mark.parametrize(
    ("strict", "status", "word"), [([], 0, "1 skipped"), (["--gwrms-strict"], 1, "1 failed")]
)
def test_what_a_slow_computer_cannot_judge_is_skipped_or_with_strict_fails(
    folder: Path, strict: list[str], status: int, word: str
) -> None:
    (folder / "conftest.py").write_text(ALWAYS_SLOW, encoding="utf-8")
    put(folder, "holds", FAILS)
    said = run(folder, "--gwrms", "scenarios", *strict, status=status)
    assert word in said
    assert "inconclusive: this computer was too slow" in said


def test_it_comes_with_the_package_and_loads_nothing_of_the_simulator_before_it_is_asked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert project["entry-points"]["pytest11"] == {"gwrms": "hil_sim.pytest_plugin"}
    program = (
        "import hil_sim.pytest_plugin, sys; "
        "print([name for name in sys.modules if name.startswith(('hil_sim.', 'eds', 'gateway'))])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "['hil_sim.pytest_plugin']"


def test_a_folder_that_is_not_there_is_wrong_usage(folder: Path) -> None:
    assert "--gwrms none: there is no such file or folder" in run(folder, "--gwrms", "none", status=4)
