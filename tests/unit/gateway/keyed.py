"""Robots with keys, and people who have some: key pairs are made once a run, because that takes a moment."""

import atexit
import functools
import shutil
import socket
import ssl
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from gateway.certificates import der_of, fingerprint
from gateway.key_making import make
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S
from tests.unit.gateway.harness import Client

ROBOT: Final = "robot"
_OWN_CA: Final = """
[ca]
default_ca = own
[own]
database = {folder}/index.txt
serial = {folder}/serial
new_certs_dir = {folder}
default_md = sha256
policy = any
x509_extensions = extensions
[any]
commonName = supplied
[extensions]
basicConstraints = critical, {more}
[req]
distinguished_name = name
prompt = no
[name]
CN = {name}
"""
PEOPLE: Final = {role.value: role for role in Role}  # each called as what they are


@functools.cache
def _folder() -> Path:
    made = Path(tempfile.mkdtemp(prefix="gwrms-keys-"))
    atexit.register(shutil.rmtree, made)
    return made


@functools.cache
def pair(name: str) -> tuple[Path, Path]:
    """A key and its certificate."""
    key, certificate = _folder() / f"{name}.key", _folder() / f"{name}.crt"
    make(name, key, certificate)
    return key, certificate


def dated(name: str, begins: str, ends: str, more: str = "CA:FALSE") -> tuple[Path, Path]:
    """One that is valid at other times, as `20490101000000Z`."""
    folder = _folder() / name
    folder.mkdir()
    settings = _OWN_CA.format(folder=folder, name=name, more=more)
    (folder / "ca.cnf").write_text(settings, encoding="ascii")
    (folder / "index.txt").touch()
    key, certificate = folder / f"{name}.key", folder / f"{name}.crt"
    openssl("ecparam", "-name", "prime256v1", "-genkey", "-noout", "-out", str(key))
    openssl("req", "-new", "-key", str(key), "-config", str(folder / "ca.cnf"), "-out", str(folder / "csr"))
    dates = ("-startdate", begins, "-enddate", ends)
    own = ("-selfsign", "-keyfile", str(key), "-in", str(folder / "csr"), "-out", str(certificate))
    openssl("ca", "-batch", "-notext", "-rand_serial", "-config", str(folder / "ca.cnf"), *own, *dates)
    return key, certificate


def vouched_for(name: str, by: tuple[Path, Path]) -> tuple[Path, Path]:
    """One that another key has signed."""
    folder = _folder() / name
    folder.mkdir()
    key, certificate = folder / f"{name}.key", folder / f"{name}.crt"
    openssl("ecparam", "-name", "prime256v1", "-genkey", "-noout", "-out", str(key))
    openssl("req", "-new", "-key", str(key), "-subj", f"/CN={name}", "-out", str(folder / "csr"))
    signed = ("-CA", str(by[1]), "-CAkey", str(by[0]), "-CAcreateserial")
    openssl("x509", "-req", "-in", str(folder / "csr"), *signed, "-out", str(certificate))
    return key, certificate


def openssl(*arguments: str) -> None:
    subprocess.run(["openssl", *arguments], check=True, capture_output=True)


def pin(name: str) -> str:
    return fingerprint(der_of(pair(name)[1].read_bytes()))


def keyed(folder: Path, people: dict[str, Role] = PEOPLE, more: str = "") -> Path:
    """Give the robot of that folder a key, and make these people known."""
    keys, clients = folder / "keys", folder / "clients"
    keys.mkdir(mode=0o700, exist_ok=True)
    clients.mkdir(exist_ok=True)
    for file, suffix in zip(pair(ROBOT), ("key", "crt"), strict=True):
        shutil.copy(file, keys / f"robot.{suffix}")
    lines = "".join(f'{name} = "{role.value}"\n' for name, role in people.items())
    (folder / "access.toml").write_text(f"[clients]\n{lines}{more}", encoding="utf-8")
    for name in people:
        shutil.copy(pair(name)[1], clients / f"{name}.crt")
    return folder


def context(pair_: tuple[Path, Path] | None) -> ssl.SSLContext:
    """As a client of somebody's own has it; `None` has no key."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    made.check_hostname = False
    made.verify_mode = ssl.CERT_NONE
    if pair_ is not None:
        made.load_cert_chain(pair_[1], pair_[0])
    return made


class KeyedClient(Client):
    """One connection by TLS, of somebody."""

    def __init__(self, address: tuple[str, int], whose: "str | tuple[Path, Path] | None") -> None:
        self._context = context(pair(whose) if isinstance(whose, str) else whose)
        super().__init__(address)

    def _connected(self, address: tuple[str, int]) -> socket.socket:
        plain = super()._connected(address)
        try:
            return self._context.wrap_socket(plain)
        except OSError:
            plain.close()
            raise


def raw(address: tuple[str, int]) -> socket.socket:
    """A bare connection, which has said nothing."""
    return socket.create_connection(address, timeout=WAIT_S)


def said(bare: socket.socket) -> bytes:
    """All that it is told, until it is closed."""
    found = b""
    try:
        while more := bare.recv(4096):
            found += more
    except ConnectionResetError:
        pass
    return found
