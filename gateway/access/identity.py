"""Who somebody is, and what they may do."""

from typing import Final

from msgspec import Struct

from gateway.wire.role import Role


class Peer(Struct, frozen=True):
    """A process of this computer, by the account that it connected as."""

    uid: int
    gid: int


class Identity(Struct, frozen=True):
    """Somebody, and by what they are known: a certificate's SHA-256, or an account of this computer."""

    role: Role
    name: str | None = None  # None: nobody in particular, by the loopback of a robot without keys
    fingerprint: str | None = None
    peer: Peer | None = None
    granted: tuple[str, ...] = ()  # what operators may on this robot beyond their role


ANYBODY: Final = Identity(Role.MAINTAINER)  # who comes by the loopback, as long as there are no keys
