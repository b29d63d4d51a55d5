"""Everybody whom a robot knows, each with a role: clients by certificates, people on it by their accounts."""

import logging
import threading
from collections.abc import Mapping
from dataclasses import dataclass

from gateway.access.folder import AccessFolder, Stamp
from gateway.access.identity import Identity
from gateway.access.table import AccessTable, table_of
from gateway.access.users import identity_of
from gateway.certificates import NAME, KeyProblem, der_of, fingerprint
from gateway.wire.role import Role

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class KnownClients:
    """All of them, at one moment; `problems` says in words what could not be read."""

    table: AccessTable
    by_key: Mapping[str, Identity]  # by fingerprint
    certificates: tuple[bytes, ...]  # of all of them (DER)
    problems: tuple[str, ...]

    def knows(self, who: Identity) -> bool:
        """Return whether that is still the same client, with the same role."""
        if who.fingerprint is not None:
            return self.by_key.get(who.fingerprint) == who
        return who.peer is None or identity_of(who.peer, self.table) == who


class Access:
    """The folder's people as they are now; read again whenever a file has changed. From any thread."""

    def __init__(self, folder: AccessFolder) -> None:
        self.folder = folder
        self._lock = threading.Lock()
        self._stamp: Stamp | None = None
        self._known: KnownClients | None = None

    def now(self) -> KnownClients:
        """Return the same object as long as nothing has changed."""
        with self._lock:
            stamp = self.folder.stamp()
            if self._known is None or stamp != self._stamp:
                self._stamp, self._known = stamp, known_in(self.folder)
                for problem in self._known.problems:
                    log.warning("%s", problem)
            return self._known


def known_in(folder: AccessFolder) -> KnownClients:
    """Read the known clients; unreadable ones are left out. A client without a role is a viewer."""
    table, problems = table_of(folder)
    by_key: dict[str, Identity] = {}
    found: list[bytes] = []
    problems += _unreadable(folder)
    for file in folder.files():
        try:
            der = der_of(file.read_bytes())
            if not NAME.fullmatch(file.stem):
                raise KeyProblem("its name is none that a client can have")
        except (OSError, KeyProblem) as error:
            problems.append(f"{file}: {error}; whom it belongs to is not let in")
            continue
        of = fingerprint(der)
        if of in by_key:
            problems.append(f"{file}: is the certificate of {by_key[of].name} too; only that one counts")
            continue
        if file.stem not in table.clients:
            problems.append(f"{folder.table}: [clients] {file.stem} has no role, and may look and stop only")
        role = table.clients.get(file.stem, Role.VIEWER)
        by_key[of] = Identity(role, file.stem, of, granted=table.operators.may)
        found.append(der)
    return KnownClients(table, by_key, tuple(found), tuple(problems))


def _unreadable(folder: AccessFolder) -> list[str]:
    try:
        next(folder.clients.iterdir(), None)
    except FileNotFoundError:
        return []
    except OSError as error:
        return [
            f"{folder.clients} cannot be read ({error.strerror}); nobody whose certificate is there is let in"
        ]
    return []
