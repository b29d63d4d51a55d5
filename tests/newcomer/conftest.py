"""The environment where newcomers work: what the desk takes, a cluster and pytest; made once for all."""

import fcntl
import os
import subprocess
from pathlib import Path

import pytest

from tests.support.extras import ROOT, brought, needed
from tests.support.installed import build, install

WITH = ("server", "cluster")


@pytest.fixture(scope="session")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Those of the environment; whoever tests at the same time has the same."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    folder = shared / "newcomer"
    with (shared / "newcomer.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "made").exists():
            _make(folder)
            (folder / "made").touch()
    return folder / "environment" / "bin"


def _make(folder: Path) -> None:
    folder.mkdir()
    packages = set[str]().union(*map(brought, WITH), needed(["pytest"]))
    programs = install(build("wheel", ROOT, folder), packages, folder / "environment")
    said = "cat requirements.lock pyproject.toml | cksum"  # as ./dev does, to know whether it is to be made
    made_from = subprocess.run(["sh", "-c", said], cwd=ROOT, check=True, capture_output=True)
    (programs.parent / ".made-from").write_bytes(made_from.stdout)
    # Nothing of pytest's is installed but what is imported.
    (programs / "pytest").write_text(f'#!/bin/sh\nexec "{programs}/python" -m pytest "$@"\n')
    (programs / "pytest").chmod(0o755)
