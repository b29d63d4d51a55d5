"""Changes to a robot's access folder: make keys, add and remove clients."""

import contextlib
import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

from gateway.access.folder import KEYS, AccessFolder
from gateway.certificates import NAME, KeyProblem, der_of, fingerprint, pem_of
from gateway.key_making import alone_in, make, write_file
from gateway.tables.entries import NoSuchLine, with_entry, without_entry
from gateway.wire.role import Role

_HEAD = """\
# Who may do what on this robot. viewer: look, and stop. operator: also take the lease, write, try.
# maintainer: also store, restore, reset, enable, command lines, and take a lease over.
# gwrms keys pair, list and revoke change it; it counts at once.

[users]    # of this computer, at the gateway's Unix socket
[groups]
[operators]
may = []   # "reset", "enable"
[clients]  # by the names of their certificates in clients/
"""


def ensure_keys(folder: AccessFolder, robot: str) -> AccessFolder:
    """Return the folder with the keys that it pairs with; they are made where there are none.

    A robot's first key waits beside the folder of its keys until `admit` puts it there: a pairing that was
    cancelled, killed or in vain has changed nothing, and the next one goes on with the same key.

    Raises `KeyProblem`.
    """
    with _alone(folder):
        pairing = folder.for_pairing
        if not (pairing.key.exists() and pairing.certificate.exists()):
            make(_file_name(robot), pairing.key, pairing.certificate)
        return pairing


def own_fingerprint(folder: AccessFolder) -> str:
    """Return the robot's; raises `KeyProblem`."""
    try:
        return fingerprint(der_of(folder.certificate.read_bytes()))
    except OSError as error:
        raise KeyProblem(f"{folder.certificate} cannot be read: {error.strerror}") from error


def add(folder: AccessFolder, name: str, der: bytes, role: Role) -> None:
    """Make a client known: first its role, then its certificate, so that it is never more than meant.

    Raises:
        KeyProblem: there is one of that name, or with that certificate, or it cannot be written.

    """
    with _alone(folder):
        _add(folder, name, der, role)


def admit(pairing: AccessFolder, own: str, name: str, der: bytes, role: Role) -> bool:
    """Make a desk known that has seen the robot's key `own`; whether that is the robot's from now on only.

    The desk comes first, then the key, in one step: at no moment has the robot a key that lets nobody in.
    Where two pair at once, both have seen the same key.

    Raises:
        KeyProblem: as `add`; or the robot has another key meanwhile, or none.

    """
    with _alone(pairing):
        now = pairing.for_pairing
        if own_fingerprint(now) != own:
            raise KeyProblem(f"the robot has another key in {now.keys} meanwhile; pair again")
        _add(now, name, der, role)
        if now.waits:
            _publish(now, name)
        return now.waits


def _publish(waiting: AccessFolder, first: str) -> None:
    """Make the key that waits the robot's own; where that fails, the first desk is not known either."""
    keys = waiting.folder / KEYS
    try:
        waiting.keys.rename(keys)
        _sync(waiting.folder)
    except OSError as error:
        with contextlib.suppress(KeyProblem):
            _without_certificates(waiting, first)
        raise KeyProblem(f"{keys} cannot be made: {error.strerror or error}") from error


def _sync(folder: Path) -> None:
    """Make what was renamed there outlast a loss of power."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def check_free(folder: AccessFolder, name: str) -> None:
    """Raise `KeyProblem` where nobody new can have this name."""
    if not NAME.fullmatch(name):
        raise KeyProblem(f"{name!r} is no name: letters, digits, _, . and -, at most 64")
    if (folder.clients / f"{name}.crt").exists():
        raise KeyProblem(f"{name} is known already; take another name, or revoke that one first")


def _add(folder: AccessFolder, name: str, der: bytes, role: Role) -> None:
    check_free(folder, name)
    file = folder.clients / f"{name}.crt"
    if (other := _known_as(folder, der)) is not None:
        raise KeyProblem(f"this key is known already, as {other}; revoke that one first")
    _edit(folder, lambda text: with_entry(text or _HEAD, "clients", name, role.value))
    try:
        _ensure_clients(folder.clients)
        write_file(file, pem_of(der), 0o644)
    except OSError as error:
        raise KeyProblem(f"{file} cannot be written: {error.strerror or error}") from error


def _ensure_clients(clients: Path) -> None:
    """Make the folder, readable for the gateway's account whatever the mask: nothing there is secret."""
    if not clients.exists():
        clients.mkdir(parents=True)
        clients.chmod(0o755)


def remove(folder: AccessFolder, name: str) -> None:
    """Forget a client, under every name that its certificate has: first that, then the role.

    Raises:
        KeyProblem: there is none, or it stays.

    """
    names = _without_certificates(folder, name)  # whoever locks the folder keeps nobody in
    try:
        with _alone(folder):
            for one in names:
                _edit(folder, partial(without_entry, table="clients", key=one))
    except KeyProblem as error:
        raise KeyProblem(
            f"{name} is no longer admitted, but its role is still in the file: {error}"
        ) from error


def _without_certificates(folder: AccessFolder, name: str) -> list[str]:
    """Remove them; the names that they had."""
    files = {one.stem: one for one in folder.files()}
    if name not in files:
        raise KeyProblem(f"there is no {name}; known are {', '.join(files) or 'nobody'}")
    der = _certificate(files[name])
    same = [one for one, file in files.items() if der is not None and _certificate(file) == der]
    names = list(dict.fromkeys((name, *same)))
    for one in names:
        try:
            files[one].unlink(missing_ok=True)
        except OSError as error:
            problem = f"{files[one]} cannot be removed: {error.strerror}; {name} IS STILL LET IN"
            raise KeyProblem(problem) from error
    return names


@contextlib.contextmanager
def _alone(folder: AccessFolder) -> Iterator[None]:
    """One command at a time: of two, none makes another key beside the first, or loses the other's line."""
    try:
        with alone_in(folder.folder):
            yield
    except OSError as error:
        raise KeyProblem(f"{folder.folder} cannot be changed: {error.strerror or error}") from error


def _known_as(folder: AccessFolder, der: bytes) -> str | None:
    return next((one.stem for one in folder.files() if _certificate(one) == der), None)


def _certificate(file: Path) -> bytes | None:
    try:
        return der_of(file.read_bytes())
    except (OSError, KeyProblem):
        return None


def _edit(folder: AccessFolder, change: Callable[[str], str]) -> None:
    try:
        before = folder.table.read_text(encoding="utf-8") if folder.table.exists() else ""
        after = change(before)
        if after != before:
            folder.folder.mkdir(parents=True, exist_ok=True)
            write_file(folder.table, after.encode("utf-8"), 0o644)
    except (OSError, NoSuchLine) as error:
        raise KeyProblem(f"{folder.table}: {error}") from error


def _file_name(robot: str) -> str:
    safe = "".join(one if NAME.fullmatch(one) or one in "_.-" else "-" for one in robot)[:64]
    return safe if NAME.fullmatch(safe) else "robot"
