"""The Unix sockets of this computer's gateways: the way to one whose port takes only clients with keys."""

import os
from collections.abc import Iterator
from typing import Final

from gateway.client.address import DEFAULT_HOST, Address
from gateway.client.errors import BadAddress
from gateway.client.keys import is_loopback
from gateway.own_folders import to_look_in

_EVERYWHERE: Final = ("0.0.0.0", "::")


def local_sockets(address: Address) -> Iterator[Address]:
    """Yield those that may be of the gateway at an address of this computer; none for another computer's."""
    if address.path is not None or not is_loopback(address):
        return
    for folder in to_look_in(os.environ):
        for path in sorted(folder.glob("*.sock")):
            if path.is_socket():
                yield Address(str(path), 0)


def listens_at(address: Address, listens: str | None) -> bool | None:
    """Return whether a gateway that listens at HOST:PORT is the one that has an address of this computer.

    None: it has the same port of another address; so may another robot's.
    """
    try:
        found = Address.parse(listens or "")
    except BadAddress:
        return False
    if found.port != address.port:
        return False
    host = address.host.lower().replace("localhost", DEFAULT_HOST)
    return True if found.host in (host, *_EVERYWHERE) else None
