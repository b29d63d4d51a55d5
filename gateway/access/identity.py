"""Identity of a client, and its permissions."""

from typing import Final

from msgspec import Struct

from gateway.wire.role import Role

SHOWN: Final = 16  # hexadecimal digits of a fingerprint


class Peer(Struct, frozen=True):
    """A process of this computer, by the account that it connected as."""

    uid: int
    gid: int
    name: str = ""  # as the computer's tables have it; "" where nobody has told
    groups: tuple[str, ...] = ()  # by numbers and names


class Identity(Struct, frozen=True):
    """Somebody, and by what they are known: a certificate's SHA-256, or an account of this computer."""

    role: Role
    name: str | None = None  # None: nobody in particular, by the loopback of a robot without keys
    fingerprint: str | None = None
    peer: Peer | None = None
    granted: tuple[str, ...] = ()  # what operators may on this robot beyond their role

    @property
    def spelled(self) -> str | None:
        """The name and by what it is known, as the journal has it: `anna [57a5adb29709f45f]`."""
        if self.name is None:
            return None
        known = f"uid {self.peer.uid}" if self.peer is not None else (self.fingerprint or "")[:SHOWN]
        return f"{self.name} [{known}]"

    def called(self, peer: str, client: str = "") -> str:
        """Return the client's name for the journal: `client` is its own claim, and spells no identity."""
        said = client.replace("[", "(")
        if self.spelled is None:
            return f"{said} ({peer})" if said else peer
        return f"{self.spelled}, {said} ({peer})" if said else f"{self.spelled} ({peer})"


ANYBODY: Final = Identity(Role.MAINTAINER)  # who comes by the loopback, as long as there are no keys
