"""Key pairs and self-signed certificates (EC P-256), made by the program `openssl`."""

import contextlib
import os
import secrets
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from gateway.certificates import NAME, KeyProblem
from gateway.openssl import piped, run

DAYS: Final = 36_500  # who is no longer trusted is revoked; no clock decides about a stop
_CURVE: Final = "prime256v1"  # NIST P-256
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

    The folder is made for its owner alone (0700), and so is the key (0600).

    Raises:
        KeyProblem: there is one already, it cannot be written, or nothing here can make one.

    """
    if not NAME.fullmatch(name):
        raise KeyProblem(f"{name!r} is no name for a key: letters, digits, _, . and -, at most 64")
    for one in (key, certificate):
        if one.exists():
            raise KeyProblem(f"{one} is there already; a key is made once, and removed by hand only")
    try:
        _make(name, key, certificate)
    except OSError as error:
        raise KeyProblem(f"no key can be written to {key.parent}: {error.strerror or error}") from error


def _make(name: str, key: Path, certificate: Path) -> None:
    key.parent.mkdir(parents=True, mode=0o755, exist_ok=True)
    if not any(key.parent.iterdir()):
        key.parent.chmod(0o700)
    key_pem, certificate_pem = _made(name)
    write_file(certificate, certificate_pem, 0o644)
    write_file(key, key_pem, 0o600)


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Within the block no other process of ours changes the files of this folder; it is made where it is not.

    Whoever comes second waits: each is done in some milliseconds.

    Raises:
        OSError: it cannot be made or opened.

    """
    folder.mkdir(parents=True, mode=0o755, exist_ok=True)
    if sys.platform == "win32":
        yield  # a desk there has no locks of folders
        return
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def write_file(file: Path, content: bytes, mode: int) -> None:
    """There whole, in the place of what was there, or not at all; never readable for more than `mode`."""
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


def _made(name: str) -> tuple[bytes, bytes]:
    """A key and its certificate, both as PEM."""
    key = run(["ecparam", "-name", _CURVE, "-genkey", "-noout"], b"")
    settings = _EXTENSIONS.format(name=name).encode("ascii")
    with piped(settings) as read_settings:
        command = ["req", "-x509", "-new", "-key", "/dev/stdin", "-sha256", "-days", str(DAYS)]
        command += ["-config", f"/dev/fd/{read_settings}"]
        return key, run(command, key, read_settings)
