"""`./dev setup`: an environment whose making was interrupted is never taken for a whole one."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="dev is for a POSIX shell")
PYTHON = """#!/bin/sh
case "$*" in
"-m venv "*) mkdir -p "$3/bin" "$3/lib" && echo '#!/bin/sh' >"$3/bin/python" && chmod +x "$3/bin/python" ;;
esac
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout in a folder with a space in its name, and a Python that makes environments of nothing."""
    made = tmp_path / "a checkout"
    made.mkdir()
    shutil.copy(ROOT / "dev", made / "dev")
    (made / "requirements.lock").write_text("uv==1\n")
    (made / "pyproject.toml").write_text("")
    python = made / "python"
    python.write_text(PYTHON)
    python.chmod(0o755)
    return made


def setup(checkout: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        ["/bin/sh", checkout / "dev", "setup"],
        env={**os.environ, "PYTHON": str(checkout / "python")},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def half_made(checkout: Path, by: int) -> Path:
    """Return a file of a package that lacks others."""
    file = checkout / ".venv/lib/package.py"
    file.parent.mkdir(parents=True)
    file.touch()
    (checkout / ".venv/.making").write_text(f"{by}\n")
    return file


def test_what_was_interrupted_is_made_anew_from_nothing(checkout: Path) -> None:
    gone = subprocess.Popen(["/bin/sh", "-c", ":"])
    gone.wait()
    file = half_made(checkout, gone.pid)
    made = setup(checkout)
    assert made.returncode == 0, made.stderr
    assert "an earlier set-up was interrupted" in made.stderr
    assert not file.exists()
    assert (checkout / ".venv/.made-from").exists()
    assert not (checkout / ".venv/.making").exists()


def test_what_another_process_makes_now_is_left_to_it(checkout: Path) -> None:
    file = half_made(checkout, os.getpid())
    made = setup(checkout)
    assert made.returncode == 1
    assert f"process {os.getpid()} makes .venv now" in made.stderr
    assert file.exists()


def test_an_environment_without_pip_is_completed(checkout: Path) -> None:
    python = checkout / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text("#!/bin/sh\nexit 1\n")
    python.chmod(0o755)
    assert setup(checkout).returncode == 0
