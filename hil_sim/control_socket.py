"""The live door: a Unix socket in the simulator's folder, one JSON line a request, one line an answer.

Requests are those of `hil_sim.operator`; what is refused is answered with `{"error": "…"}`. Served in the
simulator's own loop; a client that does not fetch its answers is cut off.
"""

import json
import os
import selectors
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from hil_sim.errors import SimulatorError
from hil_sim.loop import Loop

NAME = "control"
LINE_BYTES = 65536
ANSWER_S = 10.0


class ControlSocket:
    """Listens as `control` in `folder` and lets `obey` answer."""

    def __init__(self, loop: Loop, folder: Path, obey: Callable[[object], dict[str, Any]]) -> None:
        self._loop = loop
        self._obey = obey
        self._path = folder / NAME
        self._clients: dict[socket.socket, bytes] = {}
        self._path.unlink(missing_ok=True)  # of a simulator that was killed; the folder's lock is ours
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        with _short(folder) as name:
            self._listener.bind(name)
        self._listener.listen()
        self._listener.setblocking(False)
        loop.watch(self._listener, selectors.EVENT_READ, self._accept)

    def close(self) -> None:
        for client in tuple(self._clients):
            self._drop(client)
        self._loop.forget(self._listener)
        self._listener.close()
        self._path.unlink(missing_ok=True)

    def _accept(self, _events: int) -> None:
        try:
            client, _ = self._listener.accept()
        except OSError:  # it left before we came
            return
        client.setblocking(False)
        self._clients[client] = b""
        self._loop.watch(client, selectors.EVENT_READ, partial(self._read, client))

    def _read(self, client: socket.socket, _events: int) -> None:
        try:
            data = client.recv(LINE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        *lines, rest = (self._clients[client] + data).split(b"\n")
        self._clients[client] = rest
        alive = all(self._send(client, self._answer(line)) for line in lines)
        if not (alive and data and len(rest) <= LINE_BYTES):
            self._drop(client)

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            return self._obey(json.loads(line))
        except SimulatorError as error:
            return {"error": str(error)}
        except (ValueError, RecursionError) as error:
            return {"error": f"this is no line of JSON: {error}"}

    def _send(self, client: socket.socket, answer: dict[str, Any]) -> bool:
        line = json.dumps(answer).encode() + b"\n"
        try:
            return client.send(line) == len(line)
        except OSError:
            return False

    def _drop(self, client: socket.socket) -> None:
        del self._clients[client]
        self._loop.forget(client)
        client.close()


def ask(folder: Path, request: dict[str, Any]) -> dict[str, Any]:
    """Ask the simulator that runs in `folder`; waits for its answer.

    Raises:
        SimulatorError: nobody listens there or answers, or the request was refused.

    """
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client, _short(folder) as name:
            client.settimeout(ANSWER_S)
            client.connect(name)
            client.sendall(json.dumps(request).encode() + b"\n")
            with client.makefile("rb") as lines:
                line = lines.readline()
        answer: dict[str, Any] = json.loads(line)
    except (OSError, ValueError) as error:
        raise SimulatorError(f"no simulator answers in {folder}: {_why(folder, error)}") from error
    if "error" in answer:
        raise SimulatorError(answer["error"])
    return answer


def _why(folder: Path, error: OSError | ValueError) -> str:
    """Return the reason why it does not answer, and the remedy."""
    start = f"start one: gwrms sim --dir {folder}"
    match error:
        case NotADirectoryError():
            return "that is no folder; --dir is the folder of gwrms sim"
        case FileNotFoundError() if not folder.exists():
            return f"there is no such folder; {start}"
        case FileNotFoundError() | ConnectionRefusedError():
            return f"none runs there; {start}"
        case TimeoutError():
            return f"it said nothing for {ANSWER_S:g} s"
        case OSError():
            return error.strerror or type(error).__name__
    return "it ended meanwhile, or something else listens there"


@contextmanager
def _short(folder: Path) -> Iterator[str]:
    """Return a name of the socket that fits into an address (107 bytes), however long the folder's is."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{descriptor}/{NAME}"
    finally:
        os.close(descriptor)
