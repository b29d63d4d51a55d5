"""Journal entries for every change of access: clients added or removed, roles changed."""

import logging
from collections.abc import Iterator, Mapping
from concurrent.futures import Future
from typing import TYPE_CHECKING

import msgspec
from msgspec import Struct

from gateway.access.folder import AccessFolder, Stamp
from gateway.records import durable
from gateway.records.records import Records
from gateway.wire.role import Role

if TYPE_CHECKING:
    from gateway.access.known_clients import KnownClients

log = logging.getLogger(__name__)


class Admission(Struct, frozen=True):
    """A client in the journal: its role, and the SHA-256 of its certificate, if it has one."""

    role: Role
    key: str | None = None


People = Mapping[str, Admission]  # by `client NAME`, `user NAME` or `group NAME`


class AccessJournal:
    """Journal of admissions. The last state is kept beside the journal; entries come first: none is lost."""

    def __init__(self, records: Records, folder: AccessFolder) -> None:
        self._folder = folder
        self._stamp: Stamp | None = None  # of the folder when it was looked at last
        self._journal = records.journal
        self._file = records.folder.path / "admitted.json"
        self._told: People | None = None

    def look(self) -> None:
        """Look who is let in now, if that has changed; what cannot be seen is in nobody's way."""
        try:
            stamp = self._folder.stamp()
            if stamp == self._stamp:
                return
            self._stamp = stamp
            if stamp or self._file.exists():
                from gateway.access.known_clients import known_in  # for robots that know somebody

                self.tell(known_in(self._folder))
        except OSError as error:
            log.warning("who is let in cannot be seen, and is not told: %s", error)

    def tell(self, known: "KnownClients") -> None:
        """Record the changes since the last time. In one thread at a time."""
        now, before = _people(known), self._kept() if self._told is None else self._told
        self._told = now
        written: Future[None] | None = None
        for what, whom, one in _changes(before, now):
            written = self._journal.append("gateway", what, whom=whom, role=one.role.value, key=one.key)
        if written is not None:
            written.add_done_callback(lambda done: self._keep(now, done))

    def _kept(self) -> People:
        try:
            return msgspec.json.decode(self._file.read_bytes(), type=dict[str, Admission])
        except FileNotFoundError:
            return {}
        except (OSError, msgspec.MsgspecError) as error:
            log.warning("%s cannot be read: %s; whoever is let in is told anew", self._file, error)
            return {}

    def _keep(self, people: People, written: "Future[None]") -> None:
        """In the journal's thread."""
        if written.exception() is not None:
            return  # the journal has said why; the next gateway tells it anew
        try:
            durable.write(self._file, msgspec.json.encode(people))
        except OSError as error:
            log.warning("%s cannot be written: %s", self._file, error.strerror or error)


def _people(known: "KnownClients") -> People:
    found = {f"client {one.name}": Admission(one.role, one.fingerprint) for one in known.by_key.values()}
    found |= {f"user {name}": Admission(role) for name, role in known.table.users.items()}
    return found | {f"group {name}": Admission(role) for name, role in known.table.groups.items()}


def _changes(before: People, now: People) -> Iterator[tuple[str, str, Admission]]:
    for whom, one in before.items():
        if whom not in now or now[whom].key != one.key:
            yield "let in no more", whom, one
    for whom, one in now.items():
        if whom not in before or before[whom].key != one.key:
            yield "let in", whom, one
        elif before[whom] != one:
            yield f"role changed from {before[whom].role.value}", whom, one
