"""Mutants of one module, each with one comparison, sign or condition changed, and the tests to fail it.

`python -m tests.mutation.mutants MODULE TEST …` prints the mutants that no test has noticed, one a line. Each
lives in a process of its own, forked before the module was imported.
"""

import ast
import gc
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

import canopen  # noqa: F401 - what takes long is imported once, here, and not in every child
import psutil  # noqa: F401
import pytest
from hypothesis import Phase, settings

from tests.mutation.operators import Kind, mutants

# Only whether they pass is asked: nothing is rewritten, traced or searched for to say it better.
_OPTIONS = ("-x", "-q", "-p", "no:cacheprovider", "-p", "pytest_timeout", "--assert", "plain", "--tb", "no")
settings.register_profile("noticed", phases=(Phase.explicit, Phase.generate), database=None)
MOST_S = 60  # a mutant that makes a test hang is noticed too


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives the mutant to whoever imports the module."""

    def __init__(self, name: str, tree: ast.Module, path: str) -> None:
        self._name = name
        self._code = compile(tree, path, "exec")

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        return importlib.util.spec_from_loader(name, self) if name == self._name else None

    def exec_module(self, module: ModuleType) -> None:
        exec(self._code, vars(module))  # our own code, changed in one place


def start(name: str, tree: ast.Module, path: str, tests: Sequence[str], folder: str) -> int:
    """Run the tests in a child, with this in place of the module; its id. It ends with 0 if they pass."""
    child = os.fork()
    if child == 0:
        signal.alarm(MOST_S)
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
        settings.load_profile("noticed")
        sys.meta_path.insert(0, _Finder(name, tree, path))
        os._exit(pytest.main([*_OPTIONS, "--basetemp", f"{folder}/{os.getpid()}", *tests]))
    return child


def survivors(name: str, tests: Sequence[str]) -> list[str]:
    """The mutants of a module that no test notices; in a process of its own."""
    command = [sys.executable, "-m", "tests.mutation.mutants", name, *tests]
    shown = subprocess.run(command, capture_output=True, text=True, check=False)
    if shown.returncode:
        raise RuntimeError(shown.stderr)
    return shown.stdout.splitlines()


def main(name: str, *tests: str) -> None:
    """Print what survives; the module as it is must pass, or nothing is shown by a failure."""
    spec = importlib.util.find_spec(name)
    if spec is None or spec.origin is None:
        raise SystemExit(f"there is no module {name}")
    tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    gc.freeze()  # what is here already is no child's to collect
    with tempfile.TemporaryDirectory() as folder:
        if os.waitpid(start(name, tree, spec.origin, tests, folder), 0)[1]:
            raise SystemExit(f"{', '.join(tests)}: do not pass with {name} as it is")
        running: dict[int, str] = {}
        for what, mutant in mutants(tree, Kind.DECISIONS):
            if len(running) >= (os.cpu_count() or 1):
                _tell_next(running)
            running[start(name, mutant, spec.origin, tests, folder)] = what
        while running:
            _tell_next(running)


def _tell_next(running: dict[int, str]) -> None:
    """Wait for one child, and print its mutant if it survived."""
    child, status = os.wait()
    what = running.pop(child)
    if status == 0:
        sys.stdout.write(f"{what}\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
