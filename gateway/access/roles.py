"""Permissions of each role: the one table, from the declarations of the wire's methods."""

from collections.abc import Mapping
from typing import Any, Final

from gateway.access.identity import Identity
from gateway.wire.control import CONTROL_ACQUIRE
from gateway.wire.framing import ErrorKind, RpcError, refuse
from gateway.wire.method import AnyMethod
from gateway.wire.methods import METHODS
from gateway.wire.resource import RESOURCE_SNAPSHOT
from gateway.wire.role import Role
from gateway.wire.stop import ROBOT_ENABLE, ROBOT_RESET

# What a method's own parameters ask for beyond it: method and field, the value that does, what it is called.
BEYOND: Final[Mapping[str, tuple[str, Any, str]]] = {
    RESOURCE_SNAPSHOT.name: ("include", "cmdline", "command lines of processes"),
    CONTROL_ACQUIRE.name: ("take_over", True, "taking over another client's lease"),
}
GRANTED: Final[Mapping[str, AnyMethod]] = {"reset": ROBOT_RESET, "enable": ROBOT_ENABLE}  # to operators


def least(who: Identity, method: AnyMethod) -> Role:
    """Return the least role that may ask for a method, on the robot where `who` is known."""
    granted = {GRANTED[word].name for word in who.granted}
    return Role.OPERATOR if method.name in granted else method.role


def check(who: Identity, method: AnyMethod) -> None:
    """Raise `RpcError` (not_allowed) where `who` may not ask for this method at all."""
    if not who.role.includes(needed := least(who, method)):
        raise _refusal(who, needed, method.name)


def check_params(who: Identity, method: AnyMethod, params: Any) -> None:
    """Check the role also for the parameters of the request."""
    field, value, what = BEYOND.get(method.name, ("", None, ""))
    if field and not who.role.includes(Role.MAINTAINER) and _asks(getattr(params, field), value):
        raise _refusal(who, Role.MAINTAINER, what)


def refused(who: Identity) -> dict[str, str]:
    """Return the methods that `who` may not ask for, and why, in words."""
    needed = {name: least(who, method) for name, method in METHODS.items()}
    return {
        name: str(_refusal(who, role, name)) for name, role in needed.items() if not who.role.includes(role)
    }


def _refusal(who: Identity, needed: Role, what: str) -> RpcError:
    name = who.name or "this client"
    text = f"{name} is {_a(who.role)} on this robot, and {what} is for {_a(needed)}; ask one"
    return refuse(ErrorKind.NOT_ALLOWED, text)


def _a(role: Role) -> str:
    return f"{'an' if role is Role.OPERATOR else 'a'} {role.value}"


def _asks(found: Any, value: Any) -> bool:
    return value in found if isinstance(found, list) else found == value
