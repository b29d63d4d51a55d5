"""Simulator and gateway, each a process of its own that can be killed and started again."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from server_gui.processes.children import Child, ChildFailed
from tests.support.waiting import WAIT_S, until


def nothing() -> None:
    pass


def gwrms(*arguments: str) -> subprocess.CompletedProcess[str]:
    """One command, as a person types it."""
    command = [sys.executable, "-P", "-m", "gateway.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=WAIT_S, check=False)


class Bench:
    """A simulator and a gateway, each of which can be killed and started again."""

    simulator_options: tuple[str, ...] = ()

    def __init__(self, folder: Path, processes: ExitStack) -> None:
        self.folder = folder
        self._processes = processes
        self.port = 0
        self.start_simulator()
        self.start_gateway()

    def start_simulator(self) -> None:
        arguments = ["sim", "--dir", str(self.folder), *self.simulator_options]
        self.simulator = self._processes.enter_context(Child("simulator", arguments))
        ready = self.simulator.wait_ready(_json, WAIT_S, nothing)
        assert ready["ready"] is True
        self.config = Path(ready["config"])

    def start_gateway(self) -> None:
        arguments = ["gateway", str(self.config), "--port", str(self.port)]
        self.gateway = self._processes.enter_context(Child("gateway", arguments))
        host, port = self.gateway.wait_ready(listening, WAIT_S, nothing)
        assert host == "127.0.0.1"
        self.port = port

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def kill(self, child: Child) -> None:
        """kill -9, and wait until it is dead. Its terminals may be another robot's : no link leads there."""
        if child is self.simulator:
            for one in self.folder.iterdir():
                if one.is_symlink():
                    one.unlink()
        os.kill(child.pid, signal.SIGKILL)
        until(lambda: is_dead(child))

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """One request, a line, and its answer: however late, as long as the connection stays."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=WAIT_S) as link:
            request = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
            link.sendall(json.dumps(request).encode() + b"\n")
            with link.makefile("rb") as lines:
                answer = lines.readline()
        result: dict[str, Any] = json.loads(answer)["result"]
        return result

    def until_whole(self) -> None:
        until(self.is_whole, lambda: self.ask("component.snapshot")["quality"])

    def states(self) -> dict[str, str]:
        """Every component's state."""
        quality = self.ask("component.snapshot")["quality"]
        return {name: found["state"] for name, found in quality.items()}

    def is_whole(self) -> bool:
        snapshot = self.ask("component.snapshot")
        return set(self.states().values()) == {"ok"} and snapshot["values"]["left_hip.position"] is not None


def _json(line: str) -> dict[str, Any] | None:
    found: dict[str, Any] = json.loads(line)
    return found


def listening(line: str) -> tuple[str, int] | None:
    said = re.fullmatch(r"listening on (\S+):(\d+)", line)
    return (said[1], int(said[2])) if said else None


def is_dead(child: Child) -> bool:
    try:
        child.check()
    except ChildFailed:
        return True
    return False
