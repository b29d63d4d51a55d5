"""`python -m tools.draw_wire > docs/reference/wire.md`: the reference of the wire, from what declares it."""

import sys
from collections.abc import Iterator
from types import ModuleType

from msgspec.structs import FieldInfo, fields

from gateway.wire import component, control, cost, parameter, resource, robot, stop, stream
from gateway.wire.framing import CODES
from gateway.wire.method import AnyMethod

HEAD = """# The wire

Drawn by `python -m tools.draw_wire` from `gateway/wire/`.

JSON-RPC 2.0 over TCP: one UTF-8 message a line, parameters by name. A name with `?` may be left out. Unknown
parameters are refused; results may grow, so a reader ignores what it does not know. What each field means and
may be stands beside it in the file that is named.
"""
GROUPS = (robot, cost, resource, component, stream, control, parameter, stop)
TABLE = "| method | parameters | result | answered by |\n|---|---|---|---|"
ERRORS = """
## Errors

The `data.kind` of an error is for programs, its `message` for people.

| kind | code |
|---|---|"""


def drawn() -> str:
    """The page."""
    groups = [line for group in GROUPS for line in _group(group)]
    errors = [f"| `{kind.value}` | {code} |" for kind, code in CODES.items()]
    return "\n".join([HEAD, *groups, ERRORS.removeprefix("\n"), *errors]) + "\n"


def _group(group: ModuleType) -> Iterator[str]:
    name = group.__name__.rpartition(".")[2]
    yield f"## {name.capitalize()}\n"
    yield f"{(group.__doc__ or '').strip()} (`gateway/wire/{name}.py`)\n"
    yield TABLE
    yield from map(_row, group.METHODS)
    yield ""


def _row(method: AnyMethod) -> str:
    answered = f"module `{method.module}`" if method.module else "the gateway itself"
    notes = {
        "needs the lease": method.needs_lease,
        "at once, past all that waits": method.urgent,
        "one client after the other": method.in_turn,
    }
    answered = "; ".join([answered, *(note for note, so in notes.items() if so)])
    params, result = fields(method.params), fields(method.result)
    return f"| `{method.name}` | {_names(params)} | {_names(result)} | {answered} |"


def _names(found: tuple[FieldInfo, ...]) -> str:
    return ", ".join(f"`{one.encode_name}{'' if one.required else '?'}`" for one in found) or "none"


if __name__ == "__main__":
    sys.stdout.write(drawn())
