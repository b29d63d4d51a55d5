"""A newcomer who types what a page shows, with a home and an environment in which nothing is yet."""

import os
import socket
import subprocess
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Self

from tests.newcomer.comparing import difference
from tests.newcomer.pages import ROOT, Block, Command, commands
from tests.newcomer.terminal import COLUMNS, DEADLINE_S, Terminal

SLOW = "This computer was too slow"  # what a scenario adds on a busy one
PORT: Final = "7420"  # which the pages name, and nobody here may rely on

# `gwrms` as it is installed, but that a robot which no option names is at a free port.
_GWRMS: Final = """#!/bin/sh
for word; do [ "$word" = --robot ] && exec @RUN@ "$@"; done
case $1 in
    gateway) shift && exec @RUN@ gateway --port @PORT@ "$@" ;;
    doctor | describe | snapshot | cost | bench | blame | watch | plot | top | get | set | od | params | \\
        store | restore | stop | reset | enable)
        exec @RUN@ "$@" --robot 127.0.0.1:@PORT@ ;;
    journal) [ "$2" = tail ] && exec @RUN@ "$@" --robot 127.0.0.1:@PORT@ ;;
esac
exec @RUN@ "$@"
"""


class Newcomer:
    """Types block after block; leaving ends every terminal that was opened.

    `programs` are those of the environment in which GWRMS is installed; `stand_ins` are what is typed here in
    the place of what a page names and only a real robot has.
    """

    def __init__(self, programs: Path, stand_ins: Mapping[str, str]) -> None:
        self._programs = programs
        self._stand_ins = dict(stand_ins)

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self.home = Path(stack.enter_context(TemporaryDirectory(prefix="gwrms-home-")))
            self.folder = self.home  # where it is typed
            self._port = free_port()
            self._environment = self._prepare()
            self._terminals: list[Terminal] = []
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exc: object) -> None:
        self._stack.close()

    def type(self, block: Block) -> None:
        """Do what a block shows, and compare what comes of it."""
        if block.file is not None:
            at_home = block.file.startswith("~/")
            file = (self.home if at_home else self.folder) / block.file.removeprefix("~/")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(self.here(block.text), encoding="utf-8")
        elif block.is_script:
            (self.folder / "script.py").write_text(self.here(block.text), encoding="utf-8")
            self.run(Command("python3 script.py > /dev/null"))
        elif block.is_shell and not block.by_hand:
            for command in commands(block):
                self._run(command, block)

    def start(self, command: Command) -> None:
        """Let it run in a terminal of its own, until it has said what it is to show."""
        terminal = Terminal(command, self.folder, self._environment)
        self._stack.callback(terminal.end)
        self._terminals.append(terminal)
        terminal.wait()

    def end(self) -> None:
        """Ctrl-C in every terminal, the newest first."""
        while self._terminals:
            self.close()

    def close(self) -> None:
        """Ctrl-C in the newest terminal: it ends well."""
        terminal = self._terminals.pop()
        assert terminal.end() in (0, 130), terminal.said

    def _run(self, command: Command, block: Block) -> None:
        here = Command(self.here(command.typed), command.shown)
        if block.terminal:
            self.start(here)
            if block.closed:
                self.close()
        else:
            self.run(here)

    def run(self, here: Command) -> None:
        """Wait for its end, which is well, and compare what it has said."""
        ran = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", here.typed],
            cwd=self.folder,
            env=self._environment,
            input="y\n",  # whoever is asked says yes, and presses Enter
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=DEADLINE_S,
            check=False,
        )
        assert ran.returncode == 0, f"{here.typed}\n{ran.stdout}"
        said = "".join(line for line in ran.stdout.splitlines(keepends=True) if not line.startswith(SLOW))
        wrong = difference(here.shown, said)
        assert wrong is None, f"{here.typed}\n{wrong}"

    def here(self, text: str) -> str:
        """Return what is typed here in the place of what a page names."""
        for word, stand_in in {PORT: str(self._port), **self._stand_ins}.items():
            text = text.replace(word, stand_in)
        return text

    def call(self, word: str, here: str) -> None:
        """Type this in the place of a word."""
        self._stand_ins[word] = here

    def set(self, **variables: str) -> None:
        """Have these in the environment of what is typed from now on."""
        self._environment |= variables

    def clone(self) -> None:
        """Be in a clone whose environment is made, as far as its own door looks."""
        self.folder = self.home / "clone"
        self.folder.mkdir()
        for name in ("dev", "pyproject.toml", "requirements.lock"):
            (self.folder / name).symlink_to(ROOT / name)
        (self.folder / ".venv").symlink_to(self._programs.parent)

    def _prepare(self) -> dict[str, str]:
        folder = self.home / "bin"
        folder.mkdir()
        run = f"'{self._programs / 'gwrms'}'"
        _install(folder / "gwrms", _GWRMS.replace("@RUN@", run).replace("@PORT@", str(self._port)))
        path = os.pathsep.join([str(folder), str(self._programs), "/usr/local/bin:/usr/bin:/bin"])
        known = {"HOME": str(self.home), "PATH": path, "LANG": "C.UTF-8", "TERM": "xterm-256color"}
        return known | {"COLUMNS": str(COLUMNS)}


def _install(program: Path, text: str) -> None:
    program.write_text(text, encoding="utf-8")
    program.chmod(0o755)


def free_port() -> int:
    """Of this computer."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
