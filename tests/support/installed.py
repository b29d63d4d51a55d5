"""GWRMS as it is installed: its wheel in an environment of its own, where nothing of the clone is.

No package index is asked: what else is wanted is linked from the environment that the tests run in.
"""

import importlib.metadata
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path


def build(kind: str, source: Path, into: Path) -> Path:
    """A `wheel` or `sdist` of what lies there."""
    before = set(into.iterdir())
    command = [sys.executable, "-m", "hatchling", "build", "-t", kind, "-d", str(into)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)
    (built,) = set(into.iterdir()) - before
    return built


def install(wheel: Path, packages: Iterable[str], environment: Path) -> Path:
    """Make the environment, with the wheel and these packages; where its programs are."""
    programs = environment / "bin"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    command = [sys.executable, "-m", "uv", "pip", "install", "--quiet", "--offline", "--no-deps"]
    subprocess.run([*command, "--python", programs / "python", wheel], check=True)
    (site_packages,) = environment.glob("lib/python*/site-packages")
    for name in packages:
        _link(importlib.metadata.distribution(name), site_packages)
    return programs


def _link(package: importlib.metadata.Distribution, into: Path) -> None:
    tops = {file.parts[0] for file in package.files or () if file.parts[0] not in ("..", "__pycache__")}
    for top in tops:
        if not (into / top).exists():
            (into / top).symlink_to(Path(str(package.locate_file(top))))
