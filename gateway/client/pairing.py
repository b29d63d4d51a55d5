"""The desk's side of pairing: proves a robot's code, and pins its key in the server's file."""

import itertools
import re
import socket
import ssl
import time
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import msgspec

from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.client.address import DEFAULT_PORT, Address
from gateway.client.errors import ClientError, NotPaired, Unreachable, WrongRobot
from gateway.client.keys import CERTIFICATE, KEY, keys_folder, server_file
from gateway.key_making import alone_in, make, write_file
from gateway.private import check_private
from gateway.tables.entries import with_entry
from gateway.user_name import user_name
from gateway.wire.pairing import (
    DESK,
    LINE_BYTES,
    PAIRING_PORT,
    ROBOT,
    SAY_S,
    VALID_S,
    Offer,
    Reply,
    is_link,
    normal,
    of_link,
    proof,
    proves,
)

_LOOK_S: Final = 0.2  # between looks whether the desk has given up


@dataclass(frozen=True, slots=True)
class Paired:
    """A robot that this desk knows now, and that knows this desk."""

    robot: str  # its own name
    address: Address  # of its gateway, pinned
    name: str  # what it calls this desk
    role: str


def typed(where: str, code: str = "") -> tuple[Address, str]:
    """Return address and code as typed: HOST:PORT and the code, or the link that has both.

    Raises:
        ValueError: it is neither; it says which of the two is wrong.

    """
    if is_link(where):
        where, code = of_link(where)
    return place(where), normal(code)


def place(where: str) -> Address:
    """Return the typed address of a robot that pairs; raises `ValueError` if it is no HOST:PORT."""
    found = Address.parse(where.strip())
    if found.path is not None:
        raise ValueError("a robot pairs at HOST:PORT, as it shows it, not at a path")
    return Address(found.host, PAIRING_PORT if found.port == DEFAULT_PORT else found.port)


def pair(
    where: Address, code: str, name: str | None = None, given_up: Callable[[], bool] = lambda: False
) -> Paired:
    """Pair with the robot that shows `code` at `where`; waits until a person there has confirmed it.

    This desk's key is made where it has none. Nothing is pinned yet: see `pin`. It ends within some seconds
    of `given_up`, which is asked in this thread.

    Raises:
        ClientError: nobody answers, the code is another, it was not confirmed, or was given up.
        KeyProblem: this desk's key cannot be made or read.
        ValueError: the code is none.

    """
    pem = own_certificate()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # the proof is bound to the certificate, whichever it is
    try:
        with _connected(where) as plain, context.wrap_socket(plain) as secured:
            return _paired(secured, where, code, pem, name or own_name(), given_up)
    except ClientError:
        raise
    except OSError as error:
        raise _nobody(where, error) from error


def check_waits(where: Address) -> None:
    """Raise `Unreachable` where nobody pairs, before a person types a code; it costs no try."""
    try:
        _connected(where).close()
    except OSError as error:
        raise _nobody(where, error) from error


def _connected(where: Address) -> socket.socket:
    return socket.create_connection((where.host, where.port), SAY_S)


def _nobody(where: Address, error: OSError) -> Unreachable:
    return Unreachable(
        f"no robot pairs at {where} ({error.strerror or error}): does `gwrms keys pair` wait there, and is "
        "it the address that it shows?"
    )


def _paired(
    secured: ssl.SSLSocket, where: Address, code: str, pem: bytes, name: str, given_up: Callable[[], bool]
) -> Paired:
    robot = fingerprint(secured.getpeercert(binary_form=True) or b"")
    desk = fingerprint(der_of(pem))
    offer = Offer(pem.decode("ascii"), name, proof(DESK, code, robot, desk))
    secured.sendall(msgspec.json.encode(offer) + b"\n")
    reply = _reply(secured, where, given_up)
    if reply.problem is not None:
        raise NotPaired(f"{where} did not pair: {reply.problem}")
    if not proves(reply.proof, ROBOT, code, robot, desk):
        raise WrongRobot(
            f"what answers at {where} does not know the code: somebody is in between, or it is another robot"
        )
    if not 0 < reply.port < 65536:
        raise NotPaired(f"{where} says that its gateway has the port {reply.port}, which is none")
    return Paired(reply.robot, Address(where.host, reply.port, robot), reply.name, reply.role)


def _reply(secured: ssl.SSLSocket, where: Address, given_up: Callable[[], bool]) -> Reply:
    found, until_s = b"", time.monotonic() + VALID_S
    secured.settimeout(_LOOK_S)
    while b"\n" not in found and len(found) <= LINE_BYTES:
        try:
            more = secured.recv(LINE_BYTES)
        except TimeoutError:
            if given_up():
                raise NotPaired(f"pairing with {where} was given up here") from None
            if time.monotonic() >= until_s:
                raise
            continue
        if not more:
            raise NotPaired(f"{where} ended the pairing")
        found += more
    try:
        return msgspec.json.decode(found.partition(b"\n")[0], type=Reply)
    except msgspec.MsgspecError as error:
        raise NotPaired(f"what answers at {where} does not pair as a robot does: {error}") from error


def own_certificate() -> bytes:
    """Return a desk's own (PEM), made with its key where there is none; raises `KeyProblem`."""
    folder = keys_folder()
    try:
        with alone_in(folder.parent):
            if not ((folder / KEY).exists() and (folder / CERTIFICATE).exists()):
                make(own_name(), folder / KEY, folder / CERTIFICATE)
        check_private(folder / KEY)
        return (folder / CERTIFICATE).read_bytes()
    except OSError as error:
        raise KeyProblem(f"{error.filename or folder} cannot be used: {error.strerror or error}") from error


def own_name() -> str:
    """Return the name that this desk proposes to a robot: its user and computer."""
    name = f"{user_name()}-{socket.gethostname()}"
    return re.sub(r"[^A-Za-z0-9_.-]", "-", name).lstrip("_.-")[:64] or "desk"


def pin(robot: str, address: Address, file: Path | None = None) -> str:
    """Write a paired robot into the server's file; the name that it has there.

    That is the one under which its address stands there already, else its own. What else is there stays.

    Raises:
        WrongRobot: another key is pinned under that name.
        ClientError: the file cannot be read or written.

    """
    file = file or server_file()
    try:
        with alone_in(file.parent):
            return _pin(robot, address, file)
    except ClientError:
        raise
    except (OSError, ValueError) as error:
        raise ClientError(f"{file} cannot be changed: {error}") from error


def _pin(robot: str, address: Address, file: Path) -> str:
    entry = {"address": str(address), "pin": address.pin or ""}
    before = file.read_text(encoding="utf-8") if file.exists() else ""
    name, known = _entry_of(tomllib.loads(before), robot, address)
    if known not in (None, address.pin):
        raise WrongRobot(
            f"{name} IS PINNED TO ANOTHER KEY in {file}: {known}, and this robot has {address.pin}. "
            "Where its keys were made anew, remove that line and pair again"
        )
    text = with_entry(before, "robots", name, entry)
    if text != before:
        write_file(file, text.encode("utf-8"), file.stat().st_mode & 0o777 if file.exists() else 0o644)
    return name


def _entry_of(document: Mapping[str, Any], robot: str, address: Address) -> tuple[str, str | None]:
    """Return its name in the file, and the pin that stands there.

    A robot says itself how it is called: that gives it no other one's line.
    """
    robots = document.get("robots", {})
    wished = re.sub(r"[^A-Za-z0-9_.-]+", "-", robot).strip("-._") or "robot"
    taken = set(robots) if isinstance(robots, Mapping) else set()
    for name in taken:
        table = robots[name] if isinstance(robots[name], Mapping) else {"address": robots[name]}
        is_named_so = name in (robot, wished) and "pin" in table
        if is_named_so or Address.parse(str(table.get("address", ""))) == address:
            return str(name), table.get("pin")
    others = (f"{wished}-{number}" for number in itertools.count(2))
    return next(one for one in itertools.chain((wished,), others) if one not in taken), None
