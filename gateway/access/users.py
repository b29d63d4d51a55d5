"""People on the robot itself: who is at the other end of a Unix socket, as the kernel says (SO_PEERCRED)."""

import grp
import os
import pwd
import socket
import struct
from collections.abc import Iterator
from typing import Final

from gateway.access.identity import Identity, Peer
from gateway.access.table import AccessTable
from gateway.wire.role import Role

_CREDENTIALS: Final = struct.Struct("iII")  # pid, uid, gid: struct ucred of unix(7)
ROOT: Final = 0


def peer_of(connection: socket.socket) -> Peer:
    """Return the peer of a socket; raises `OSError` where the system does not tell."""
    option = getattr(socket, "SO_PEERCRED", None)
    if option is None:
        raise OSError("this system does not tell who is at a Unix socket")
    _pid, uid, gid = _CREDENTIALS.unpack(connection.getsockopt(socket.SOL_SOCKET, option, _CREDENTIALS.size))
    return Peer(uid, gid)


def is_maintainer(peer: Peer) -> bool:
    """Root, and the account that the gateway runs as, could do all of it anyway."""
    return peer.uid in (ROOT, os.geteuid())


def identity_of(peer: Peer, table: AccessTable) -> Identity | None:
    """Return the highest role that the user or one of their groups has; `None` for a stranger."""
    name, groups = peer.name or str(peer.uid), {str(peer.gid), *peer.groups}
    roles = [Role.MAINTAINER] if is_maintainer(peer) else []
    roles += [role for user, role in table.users.items() if user in (name, str(peer.uid))]
    roles += [role for group, role in table.groups.items() if group in groups]
    highest = next((role for role in reversed(Role) if role in roles), None)
    return None if highest is None else Identity(highest, name, peer=peer, granted=table.operators.may)


def resolved(peer: Peer) -> Peer:
    """Return the peer with its names in the system's directories, which may query the network.

    A name of digits alone is none here: in a table it is a number, and somebody else's.
    """
    try:
        name = pwd.getpwuid(peer.uid).pw_name
    except KeyError:
        return peer
    return Peer(peer.uid, peer.gid, "" if name.isdecimal() else name, tuple(_groups(name, peer.gid)))


def _groups(name: str, gid: int) -> Iterator[str]:
    """Yield groups by the computer's own table: a process may have given up groups of its user."""
    try:
        numbers = os.getgrouplist(name, gid)
    except (KeyError, OSError):
        numbers = [gid]
    for number in numbers:
        yield str(number)
        try:
            group = grp.getgrgid(number).gr_name
        except KeyError:
            continue
        if not group.isdecimal():
            yield group
