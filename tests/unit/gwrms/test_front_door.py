"""What a script imports is ours, whatever lies beside the script."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import gateway
import gateway.client
import gwrms

ROOT = Path(__file__).parents[3]
NOT_OURS = "raise SystemExit('this is not ours')"


def python(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )


def script(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    (folder / "script.py").write_text(text, encoding="utf-8")
    return python(folder, "script.py")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A user's folder, with a module of a name that is one of ours, and one that we need."""
    for name in ("gateway", "drivers", "serial"):
        (tmp_path / f"{name}.py").write_text(NOT_OURS, encoding="utf-8")
    return tmp_path


def test_a_module_beside_the_script_does_not_take_the_place_of_ours(folder: Path) -> None:
    said = script(folder, "from gwrms import Robot\nprint(Robot.__module__)")
    assert (said.stdout, said.stderr) == ("gateway.client.blocking\n", "")


def test_a_module_beside_the_command_does_not_take_the_place_of_ours(folder: Path) -> None:
    said = python(folder, "-m", "gwrms", "sensor", "--help")
    assert said.returncode == 0, said.stdout + said.stderr
    assert said.stdout.startswith("usage: gwrms sensor")


def test_another_module_that_was_imported_before_is_named(tmp_path: Path) -> None:
    (tmp_path / "gateway.py").touch()
    said = script(tmp_path, "import gateway\nimport gwrms")
    assert (
        f"ImportError: <module 'gateway' from '{tmp_path / 'gateway.py'}'> was imported before" in said.stderr
    )
    assert said.stderr.endswith("rename it\n")


def test_the_clients_own_names_are_there() -> None:
    assert sorted(gwrms.__all__) == sorted([*gateway.client.__all__, "__version__"])
    for name in gateway.client.__all__:
        assert getattr(gwrms, name) is getattr(gateway.client, name)
    assert gwrms.__version__ == gateway.__version__


def test_what_is_not_there_is_an_ordinary_error() -> None:
    with pytest.raises(AttributeError, match="'gwrms' has no attribute 'Robots'"):
        getattr(gwrms, "Robots")  # noqa: B009 - mypy knows that it is not there


def test_importing_it_costs_nothing_yet(tmp_path: Path) -> None:
    said = script(tmp_path, "import sys, gwrms\nprint('gateway.client' in sys.modules)")
    assert said.stdout == "False\n"
