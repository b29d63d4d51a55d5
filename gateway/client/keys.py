"""A desk's own key, and the robots that it has paired with: their certificates are pinned in server.toml.

~/.config/gwrms/keys/desk.key and desk.crt; [robots] NAME = { address = "HOST:PORT", pin = "SHA-256" }.
"""

import re
import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gateway.certificates import KeyProblem, fingerprint
from gateway.client.address import Address
from gateway.client.errors import BadAddress, NotPaired, WrongRobot
from gateway.own_folders import user_folder
from gateway.private import check_private, forbid_core_dumps

if TYPE_CHECKING:
    import ssl

KEY, CERTIFICATE = "desk.key", "desk.crt"
PIN_LENGTH: Final = 64  # hexadecimal digits of a SHA-256
_HERE: Final = re.compile(r"127(\.\d{1,3}){3}|localhost|::1")  # a name that only begins so is elsewhere


def keys_folder() -> Path:
    return user_folder() / "keys"


def server_file() -> Path:
    """Return the user's own `server.toml`, in which robots are pinned."""
    return user_folder() / "server.toml"


def is_loopback(address: Address) -> bool:
    """Return whether it is one of this computer."""
    return _HERE.fullmatch(address.host.lower()) is not None


def pin_of(address: Address) -> str | None:
    """Return the certificate that a robot must have, by its address; None where it is not paired.

    Raises:
        NotPaired: it is on another computer and not paired: nothing is said to that in plain. Or the server's
            file cannot be read, so nobody knows whether it is.

    """
    is_here = is_loopback(address)
    if address.pin is not None or address.path is not None:
        return address.pin
    try:
        robots = _robots(server_file())
    except (OSError, ValueError, RecursionError) as error:
        if is_here:
            return None  # this computer needs no pin, and a stop must come through
        raise NotPaired(
            f"{server_file()} cannot be read ({error}), so which key is {address}'s is unknown"
        ) from error
    pin = next((pin for pin, where in robots if where == address), None)
    if pin is None and not is_here:
        which = f"{address.called} ({address})" if address.called else str(address)
        other = "" if address.called else f"use the address under which it stands in {server_file()}, or "
        raise NotPaired(
            f"{which} is not paired, and another computer is only spoken to encrypted: {other}pair it (gwrms "
            "keys pair there, then gwrms pair here)"
        )
    return pin


def named(name: str) -> Address | None:
    """Return the address of a robot that the server's file calls so, with its own pin.

    None where no robot is called so, or nobody can tell, as the file cannot be read.

    Raises:
        BadAddress: it is called so, and its entry cannot be used.

    """
    try:
        entry = tomllib.loads(server_file().read_text(encoding="utf-8"))["robots"][name]
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return None
    try:
        if isinstance(entry, str):
            return replace(Address.parse(entry), called=name)
        table: Mapping[str, Any] = entry if isinstance(entry, Mapping) else {}
        where, pin = Address.parse(str(table.get("address", ""))), table.get("pin")
        where = replace(where, called=name)
        return where if pin is None else replace(where, pin=checked_pin(str(pin)))
    except ValueError as error:
        raise BadAddress(
            f"{name} stands in [robots] of {server_file()} and cannot be used: {error}"
        ) from error


def robot_names() -> list[str]:
    """Return the names of the robots in the server's file; none where it cannot be read."""
    try:
        return list(tomllib.loads(server_file().read_text(encoding="utf-8"))["robots"])
    except (OSError, ValueError, RecursionError, KeyError, TypeError):
        return []


def pins() -> set[str]:
    """Return the pins of all paired robots; raises `OSError` or `ValueError` on a bad file."""
    return {pin for pin, _ in _robots(server_file())}


def context_for(address: Address, pin: str) -> "ssl.SSLContext":
    """TLS 1.3 with this desk's key. Whoever answers is held against the pin, and against nothing else.

    Raises:
        NotPaired: this desk has no key, it cannot be read, or others can read it.

    """
    import ssl  # for who has paired

    folder = keys_folder()
    forbid_core_dumps()
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.minimum_version = ssl.TLSVersion.TLSv1_3
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # `check_pin` is stricter
    try:
        check_private(folder / KEY)
        context.load_cert_chain(folder / CERTIFICATE, folder / KEY, password=_no_password)
    except KeyProblem as error:
        raise NotPaired(f"{address} is pinned to {pin[:16]}…, but {error}") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is no key pair"
        raise NotPaired(
            f"{address} is pinned to {pin[:16]}…, but this desk's key in {folder} cannot be used ({reason}): "
            "pair it anew with gwrms pair"
        ) from None
    return context


def check_pin(address: Address, pin: str, der: bytes | None) -> None:
    """Check before a byte is said: raises `WrongRobot` if another one answers than was paired."""
    found = fingerprint(der) if der else None
    if found == pin.lower():
        return
    raise WrongRobot(
        f"ANOTHER ROBOT ANSWERS AT {address}, or somebody in between: its key is {found or 'none'}, and that "
        f"of the robot that was paired is {pin.lower()}. Nothing was sent. Where its keys were made anew, "
        f"look at them there (gwrms keys list), remove the pin from {server_file()}, and pair again"
    )


def checked_pin(text: str) -> str:
    """Return a pin in its normal form; raises `ValueError` for an invalid one."""
    if len(text) != PIN_LENGTH or not set(text.lower()) <= set("0123456789abcdef"):
        raise ValueError(f"pin is the SHA-256 of the robot's certificate, {PIN_LENGTH} hexadecimal digits")
    return text.lower()


def _robots(file: Path) -> list[tuple[str, Address]]:
    """Pins, and the addresses that they are of."""
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return []
    table = document.get("robots", {})
    entries: list[Any] = list(table.values()) if isinstance(table, Mapping) else []
    return [pinned for entry in entries if (pinned := _pinned(entry)) is not None]


def _pinned(entry: Any) -> tuple[str, Address] | None:
    if not isinstance(entry, Mapping) or "pin" not in entry:
        return None
    try:
        return checked_pin(str(entry["pin"])), Address.parse(str(entry.get("address", "")))
    except BadAddress as error:
        raise ValueError(str(error)) from error


def _no_password() -> str:
    raise ValueError("it is encrypted")
