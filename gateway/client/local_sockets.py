"""The Unix sockets of this computer's gateways: the way to one whose port takes only clients with keys."""

import os
from typing import Final

from gateway.client.address import Address
from gateway.client.errors import BadAddress
from gateway.client.keys import is_loopback, pin_of
from gateway.own_folders import to_look_in

_NAMED: Final = 3  # of them, in an error
_LOCALHOST: Final = ("127.0.0.1", "::1")


def local_sockets(address: Address) -> list[Address]:
    """Return those among which the gateway at an address of this computer may be.

    None for another computer's, nor for a paired robot's: nothing there proves to have its key.
    """
    found = _found(address)
    return found if found and pin_of(address) is None else []


def sockets_instead(address: Address) -> str:
    """Return what an error adds where somebody may have meant a gateway that has a socket here."""
    found = [one.host for one in _found(address)]
    if not found:
        return ""
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    return (
        f"; on this computer there is also {', '.join(found[:_NAMED])}{more}: "
        f"if that is the gateway you mean, give --robot {found[0]}"
    )


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


def _found(address: Address) -> list[Address]:
    if address.path is not None or not is_loopback(address):
        return []
    paths = [path for folder in to_look_in(os.environ) for path in sorted(folder.glob("*.sock"))]
    return [Address(str(path), 0) for path in paths if path.is_socket()]
