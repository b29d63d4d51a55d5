"""Simulator and gateway, each a process of its own that can be killed and started again."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from server_gui.processes.children import Child, ChildFailed

DEADLINE_S = 120.0


def nothing() -> None:
    pass


def until(
    condition: Callable[[], object],
    found: Callable[[], object] = lambda: None,
    within_s: float = DEADLINE_S,
) -> None:
    """Wait for a condition; `found` tells what there was instead."""
    deadline = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < deadline, f"not met in time: {found()}"
        time.sleep(0.05)


def gwrms(*arguments: str) -> subprocess.CompletedProcess[str]:
    """One command, as a person types it."""
    command = [sys.executable, "-P", "-m", "gateway.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S, check=False)


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
        ready = self.simulator.wait_ready(_json, DEADLINE_S, nothing)
        assert ready["ready"] is True
        self.config = Path(ready["config"])

    def start_gateway(self) -> None:
        arguments = ["gateway", str(self.config), "--port", str(self.port)]
        self.gateway = self._processes.enter_context(Child("gateway", arguments))
        host, port = self.gateway.wait_ready(listening, DEADLINE_S, nothing)
        assert host == "127.0.0.1"
        self.port = port

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def kill(self, child: Child) -> None:
        """kill -9, and wait until it is dead."""
        os.kill(child.pid, signal.SIGKILL)
        until(lambda: is_dead(child))

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        """One request as `nc` sends it: a line, then the sending half is closed; the answer until the end."""
        with socket.create_connection(("127.0.0.1", self.port), timeout=DEADLINE_S) as link:
            request = {"jsonrpc": "2.0", "id": 1, "method": method, "params": params}
            link.sendall(json.dumps(request).encode() + b"\n")
            link.shutdown(socket.SHUT_WR)
            answer = b"".join(iter(lambda: link.recv(65536), b""))
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
