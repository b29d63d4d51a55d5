"""The Unix sockets of this computer's gateways: the way to one whose port takes only clients with keys."""

import ipaddress
import os
import socket
from typing import Final

from gateway.client.address import DEFAULT_HOST, Address
from gateway.client.errors import BadAddress, NotPaired
from gateway.client.keys import is_loopback, pin_of
from gateway.own_folders import is_served, to_look_in

_NAMED: Final = 3  # of them, in an error
BROADCAST: Final = "255.255.255.255"


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
    found = [one.host for one in _found() if is_served(one.host)] if _is_ours(address) else []
    if not found:
        return ""
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    served = f"{', '.join(found[:_NAMED])}{more}"
    return (
        f"On this computer a gateway is served at {served}: is it the one you mean? Then give --robot PATH."
    )


def listens_at(address: Address, listens: str | None) -> bool:
    """Return whether a gateway that listens at HOST:PORT is the one at an address of this computer.

    One with the same port of another host is not: it may be another robot's.
    """
    try:
        found = Address.parse(listens or "")
    except BadAddress:
        return False
    host = _number(address.host)
    every = "::" if ":" in host else "0.0.0.0"
    return found.port == address.port and found.host in (host, every)


def _number(host: str) -> str:
    """Return an address as a gateway tells it; `localhost` and other names stay what they are."""
    try:
        number = ipaddress.ip_address(host)
    except ValueError:
        return DEFAULT_HOST if host.lower() == "localhost" else host
    return str(getattr(number, "ipv4_mapped", None) or number)


def _is_ours(address: Address) -> bool:
    """Return whether it is an address of this computer, of the network too; nobody is asked for a name."""
    if address.path is not None or is_loopback(address):
        return address.path is None
    try:
        number = ipaddress.ip_address(address.host)
        with socket.socket(
            socket.AF_INET6 if number.version == 6 else socket.AF_INET, socket.SOCK_DGRAM
        ) as one:
            one.bind((address.host, 0))
    except (OSError, ValueError):
        return False
    return not number.is_multicast and str(number) != BROADCAST


def _found() -> list[Address]:
    paths = [path for folder in to_look_in(os.environ) for path in sorted(folder.glob("*.sock"))]
    return [Address(str(path), 0) for path in paths if path.is_socket()]
