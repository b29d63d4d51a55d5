"""The Unix sockets of this computer's gateways: the way to one whose port takes only clients with keys."""

import os
import socket
from typing import Final

from gateway.client.address import Address
from gateway.client.errors import BadAddress, NotPaired
from gateway.client.keys import is_loopback, pin_of
from gateway.own_folders import to_look_in

_NAMED: Final = 3  # of them, in an error
_LOCALHOST: Final = ("127.0.0.1", "::1")


def local_sockets(address: Address) -> list[Address]:
    """Return those among which the gateway at an address of this computer may be.

    None for another computer's, nor for a paired robot's: nothing there proves to have its key.
    """
    if not _is_ours(address):
        return []
    try:
        is_paired = pin_of(address) is not None
    except NotPaired:  # an address of the network
        is_paired = False
    return [] if is_paired else _found()


def sockets_instead(address: Address) -> str:
    """Return the sentence of an error where a gateway that has a socket here may be meant."""
    found = [one.host for one in _found() if _is_served(one.host)] if _is_ours(address) else []
    if not found:
        return ""
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    served = f"{', '.join(found[:_NAMED])}{more}"
    return f" On this computer a gateway is served at {served}: is it the one you mean? Then --robot PATH"


def listens_at(address: Address, listens: str | None) -> bool:
    """Return whether a gateway that listens at HOST:PORT is the one at an address of this computer.

    One with the same port of another host is not: it may be another robot's.
    """
    try:
        found = Address.parse(listens or "")
    except BadAddress:
        return False
    host = address.host.lower()
    hosts = _LOCALHOST if host == "localhost" else (host,)
    every = {"::" if ":" in one else "0.0.0.0" for one in hosts}
    return found.port == address.port and found.host in (*hosts, *every)


def _is_ours(address: Address) -> bool:
    """Return whether it is an address of this computer, of the network too; nobody is asked for a name."""
    if address.path is not None:
        return False
    if is_loopback(address):
        return True
    family = socket.AF_INET6 if ":" in address.host else socket.AF_INET
    try:
        host = socket.inet_ntop(family, socket.inet_pton(family, address.host))
        with socket.socket(family, socket.SOCK_DGRAM) as trying:
            trying.bind((host, 0))
    except (OSError, ValueError):
        return False
    return True


def _found() -> list[Address]:
    paths = [path for folder in to_look_in(os.environ) for path in sorted(folder.glob("*.sock"))]
    return [Address(str(path), 0) for path in paths if path.is_socket()]


def _is_served(path: str) -> bool:
    """Return whether somebody listens there: a gateway that was killed leaves its socket."""
    with socket.socket(socket.AF_UNIX) as trying:
        trying.setblocking(False)
        try:
            trying.connect(path)
        except BlockingIOError:  # it is there, and busy
            return True
        except OSError:
            return False
    return True
