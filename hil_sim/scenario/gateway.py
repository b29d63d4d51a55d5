"""A gateway as a process of its own, and a link to it that lives in the simulator's loop.

The link speaks the wire as any program would: one line of JSON-RPC 2.0 each way.
"""

import json
import selectors
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hil_sim.errors import SimulatorError
from hil_sim.loop import Loop

READY_S = 60.0
_END_S = 10.0
_READ_BYTES = 1 << 16
_LISTENING = b"listening on "

Result = dict[str, Any]
Answered = Callable[[Result | None, str], None]  # the result, or `None` and what was refused


class GatewayFailed(SimulatorError):
    """The gateway does not run, or is gone; the message has its last words."""


class GatewayProcess:
    """`gwrms gateway` for the robot of `config`; a context that ends it. What it says goes to `log`.

    One that has `armed` the drives refuses its end as long as they are enabled: it is killed.
    """

    def __init__(self, config: Path, log: Path, *, armed: bool = False) -> None:
        self._armed = armed
        self._log = log
        self._command = [sys.executable, "-P", "-m", "gateway.main", "gateway", str(config), "--port", "0"]
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> tuple[str, int]:
        """Its address, once it listens. In the main thread: signals that come meanwhile act afterwards."""
        try:
            with _signals_later(), self._log.open("wb") as errors:
                self._process = subprocess.Popen(
                    self._command,
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    process_group=0,
                )
            return self._wait(self._process)
        except BaseException:
            self.__exit__()
            raise

    def __exit__(self, *_: object) -> None:
        if self._process is None:
            return
        if self._armed:
            self._process.kill()
        self._process.terminate()
        try:
            self._process.communicate(timeout=_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.communicate()

    @property
    def pid(self) -> int:
        """Process id of the gateway."""
        if self._process is None:
            raise RuntimeError("it is entered first")
        return self._process.pid

    def _wait(self, process: "subprocess.Popen[bytes]") -> tuple[str, int]:
        said = b""
        if process.stdout is not None:
            with selectors.DefaultSelector() as selector:
                selector.register(process.stdout, selectors.EVENT_READ)
                said = process.stdout.readline() if selector.select(READY_S) else b""
        if not said.startswith(_LISTENING):
            raise GatewayFailed(f"the gateway did not start; it said:\n{self._last_words()}")
        host, _, port = said[len(_LISTENING) :].decode().strip().rpartition(":")
        return host, int(port)

    def _last_words(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")[-2000:] or "nothing"


@contextmanager
def _signals_later() -> Iterator[None]:
    """Delay signals that would end this process until its work is done and known."""
    came: list[int] = []
    ends = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, lambda came_in, _frame: came.append(came_in)) for number in ends}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for late in came:
            signal.raise_signal(late)


class GatewayLink:
    """Asks a gateway from within the loop; answers come as calls."""

    def __init__(self, loop: Loop, address: tuple[str, int]) -> None:
        self._loop = loop
        self._socket = socket.create_connection(address, READY_S)
        self._waiting: dict[int, Answered] = {}
        self._asked = 0
        self._rest = b""
        loop.watch(self._socket, selectors.EVENT_READ, self._read)

    def close(self) -> None:
        self._loop.forget(self._socket)
        self._socket.close()

    def ask(self, method: str, params: Result, answered: Answered) -> None:
        """Send a request; `answered` is called in the loop."""
        self._asked += 1
        self._waiting[self._asked] = answered
        request = {"jsonrpc": "2.0", "id": self._asked, "method": method, "params": params}
        self._socket.sendall(json.dumps(request).encode() + b"\n")

    def _read(self, _events: int) -> None:
        data = self._socket.recv(_READ_BYTES)
        if not data:
            raise GatewayFailed("the gateway has closed the connection")
        *lines, self._rest = (self._rest + data).split(b"\n")
        for line in lines:
            self._answer(json.loads(line))

    def _answer(self, message: dict[str, Any]) -> None:
        answered = self._waiting.pop(message.get("id", 0), None)
        if answered is not None:
            error = message.get("error")
            answered(message.get("result"), "" if error is None else str(error["message"]))
