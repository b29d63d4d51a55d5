"""Key pairs and self-signed certificates (EC P-256), made by the program `openssl`."""

import contextlib
import os
import secrets
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from gateway.certificates import NAME, KeyProblem
from gateway.openssl import piped, run

DAYS: Final = 36_500  # who is no longer trusted is revoked; no clock decides about a stop
_CURVE: Final = "prime256v1"  # NIST P-256
_TURN_S: Final = 5.0  # how long somebody else's turn is waited for
_LOOK_S: Final = 0.02
_EXTENSIONS: Final = """\
[req]
distinguished_name = name
x509_extensions = own
prompt = no
[name]
CN = {name}
[own]
basicConstraints = critical, CA:FALSE
keyUsage = critical, digitalSignature
"""


def make(name: str, key: Path, certificate: Path) -> None:
    """Make a key pair for `name`; what is there already is not touched.

    The folder is made for its owner alone (0700), and so is the key (0600). A key without a certificate, as
    one that was killed leaves it, gets one.

    Raises:
        KeyProblem: there is a certificate already, it cannot be written, or nothing here can make one.

    """
    if not NAME.fullmatch(name):
        raise KeyProblem(f"{name!r} is no name for a key: letters, digits, _, . and -, at most 64")
    if certificate.exists():
        raise KeyProblem(f"{certificate} is there already; a key is made once, and removed by hand only")
    try:
        _make(name, key, certificate)
    except OSError as error:
        raise KeyProblem(f"no key can be written to {key.parent}: {error.strerror or error}") from error


def _make(name: str, key: Path, certificate: Path) -> None:
    key.parent.mkdir(parents=True, mode=0o755, exist_ok=True)
    if not any(key.parent.iterdir()):
        key.parent.chmod(0o700)
    if not key.exists():
        write_file(key, _new_key(), 0o600)
    write_file(certificate, _certificate(name, key.read_bytes()), 0o644)


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Within the block no other process of ours changes the files of this folder; it is made where it is not.

    Whoever comes second waits: each is done in some milliseconds. But whoever may read a folder can lock it,
    so nobody waits for ever.

    Raises:
        OSError: it cannot be made or opened, or another program keeps it.

    """
    folder.mkdir(parents=True, mode=0o755, exist_ok=True)
    if sys.platform == "win32":
        yield  # a desk there has no locks of folders
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        until_s = time.monotonic() + _TURN_S
        while not _locked(descriptor):
            if time.monotonic() >= until_s:
                raise TimeoutError(f"another program keeps {folder} locked; lslocks names it")
            time.sleep(_LOOK_S)
        yield
    finally:
        os.close(descriptor)


def _locked(descriptor: int) -> bool:
    """Try to lock, and return whether it is locked; the lock ends with the descriptor, also after a kill."""
    import fcntl

    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def write_file(file: Path, content: bytes, mode: int) -> None:
    """Replace the file as a whole, or not at all; it is never readable for more than `mode`."""
    draft = file.with_name(f".{file.name}.{secrets.token_hex(4)}")
    descriptor = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        os.fchmod(descriptor, mode)
        with open(descriptor, "wb") as out:  # noqa: PTH123 - of a descriptor
            out.write(content)
            out.flush()
            os.fsync(descriptor)
        draft.rename(file)
    except BaseException:
        with contextlib.suppress(OSError):
            draft.unlink()
        raise


def _new_key() -> bytes:
    """Return it as PEM."""
    return run(["ecparam", "-name", _CURVE, "-genkey", "-noout"], b"")


def _certificate(name: str, key: bytes) -> bytes:
    """Make the certificate of a key; both as PEM."""
    settings = _EXTENSIONS.format(name=name).encode("ascii")
    with piped(settings) as read_settings:
        command = ["req", "-x509", "-new", "-key", "/dev/stdin", "-sha256", "-days", str(DAYS)]
        command += ["-config", f"/dev/fd/{read_settings}"]
        return run(command, key, read_settings)
