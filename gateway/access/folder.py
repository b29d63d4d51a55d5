"""The folder of a robot's keys, its clients' certificates and their roles: beside its file, as in /etc/gwrms.

keys/robot.key and keys/robot.crt are the robot's own, clients/NAME.crt those who are known, access.toml says
what each may do. A key that was made for a first desk waits in keys.pairing/ until that desk is let in
(`changes.admit`): a gateway does not look there.
"""

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

KEY, CERTIFICATE = "robot.key", "robot.crt"
KEYS, WAITING = "keys", "keys.pairing"
CREDENTIALS: Final = "CREDENTIALS_DIRECTORY"  # where systemd puts what LoadCredential= names

Stamp = tuple[tuple[str, int, int, int], ...]


class AccessFolder:
    """The folder; every look is at the disk."""

    def __init__(self, folder: Path, environ: Mapping[str, str] = os.environ) -> None:
        self.folder = folder
        self.clients = folder / "clients"
        self.table = folder / "access.toml"
        credentials = environ.get(CREDENTIALS)
        handed = Path(credentials) if credentials else None
        self.keys = handed if handed is not None and (handed / KEY).exists() else folder / KEYS

    @property
    def for_pairing(self) -> "AccessFolder":
        """The same on the disk; where it has no keys, with those that wait for the first desk."""
        other = AccessFolder(self.folder, {})
        other.keys = other.keys if other.has_keys else self.folder / WAITING
        return other

    @property
    def waits(self) -> bool:
        """Whether its keys are such as wait."""
        return self.keys.name == WAITING

    @property
    def has_keys(self) -> bool:
        """Whether the robot has a key, or should: a folder that cannot be read is no robot without keys."""
        return self.keys.exists()

    @property
    def key(self) -> Path:
        return self.keys / KEY

    @property
    def certificate(self) -> Path:
        return self.keys / CERTIFICATE

    def files(self) -> list[Path]:
        """Clients' certificates; none, where their folder cannot be read."""
        try:
            return sorted(one for one in self.clients.iterdir() if one.suffix == ".crt")
        except OSError:
            return []

    def stamp(self) -> Stamp:
        """Return a stamp, another one whenever a client or a role has changed."""
        return tuple(_stamps((*self.files(), self.table)))


def _stamps(files: Iterable[Path]) -> Iterator[tuple[str, int, int, int]]:
    for file in files:
        try:
            found = file.stat()
        except OSError:
            continue
        yield file.name, found.st_ino, found.st_mtime_ns, found.st_size
