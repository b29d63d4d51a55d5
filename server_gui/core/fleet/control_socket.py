"""Control of a running collector: a Unix socket in its spool's folder, one JSON line in, one out."""

import asyncio
import contextlib
import inspect
import os
import socket
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from pathlib import Path
from typing import Final

import msgspec

NAME: Final = "collector"
ANSWER_S: Final = 5.0

Answers = Mapping[str, Callable[[str], object]]


class NobodyCollects(Exception):
    """No collector answers on this spool."""


class Request(msgspec.Struct, frozen=True, omit_defaults=True):
    """A request, with its text."""

    ask: str
    text: str = ""


class _Uploading(msgspec.Struct, frozen=True):
    """The uploader's problem in its last attempt."""

    problem: str | None


class _Status(msgspec.Struct, frozen=True):
    uploader: _Uploading


@contextlib.asynccontextmanager
async def door(folder: Path, answers: Answers) -> AsyncIterator[None]:
    """Answer who asks; the folder must be ours alone. `answers` are called in this loop, or awaited."""

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, TimeoutError, ValueError):  # who asked has gone, or said nothing
            async with asyncio.timeout(ANSWER_S):
                writer.write(await _answer(await reader.readline(), answers))
                await writer.drain()
        writer.close()

    (folder / NAME).unlink(missing_ok=True)  # of a collector that was killed
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    with _short(folder) as name:
        listener.bind(name)
    server = await asyncio.start_unix_server(serve, sock=listener, start_serving=False)
    try:
        await server.start_serving()
        yield
    finally:
        server.close()
        (folder / NAME).unlink(missing_ok=True)


def ask(folder: Path, what: str, text: str = "") -> bytes:
    """Ask the collector that works on this spool; return its answer, a line of JSON.

    Raises:
        NobodyCollects: nobody answers there; says whether it hangs or does not run.

    """
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking, _short(folder) as name:
            asking.settimeout(ANSWER_S)
            asking.connect(name)
            asking.sendall(msgspec.json.encode(Request(what, text)) + b"\n")
            with asking.makefile("rb") as lines:
                answer = lines.readline()
    except TimeoutError as error:
        raise NobodyCollects(
            f"the collector on the spool {folder} hangs: no answer in {ANSWER_S:g} s"
        ) from error
    except PermissionError as error:
        raise NobodyCollects(f"the spool {folder} belongs to somebody else; ask as that user") from error
    except OSError as error:
        raise NobodyCollects(f"no collector runs on the spool {folder}; start one: gwrms collect") from error
    if not answer:
        raise NobodyCollects(
            f"the collector on the spool {folder} does not know what {what!r} is, or is ending"
        )
    return answer


def why_not_uploaded(folder: Path) -> str | None:
    """Return why this spool's collector did not bring the newest batch that it tried into its store.

    Raises:
        NobodyCollects: as `ask`.

    """
    return msgspec.json.decode(ask(folder, "status"), type=_Status).uploader.problem


async def _answer(line: bytes, answers: Answers) -> bytes:
    asked = msgspec.json.decode(line, type=Request)
    answer = answers.get(asked.ask)
    if answer is None:
        return b""
    found = answer(asked.text)
    return msgspec.json.encode(await found if inspect.isawaitable(found) else found) + b"\n"


@contextlib.contextmanager
def _short(folder: Path) -> Iterator[str]:
    """Return a name of the socket that fits into an address (107 bytes), however long the folder's is."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        yield f"/proc/self/fd/{descriptor}/{NAME}"
    finally:
        os.close(descriptor)
