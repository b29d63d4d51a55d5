"""docs/reference/wire.md: every method of the wire, from where the methods are declared."""

from collections.abc import Iterator, Mapping
from typing import Final

from msgspec import Struct

from gateway.wire.framing import CODES, PROTOCOL, ErrorData
from gateway.wire.method import AnyMethod
from gateway.wire.methods import METHODS
from gateway.wire.stream import STREAM_DATA, StreamData
from tools.draw.structs import docstring, mentioned, sent, table

PAGE: Final = "wire.md"
SERVICE: Final = "the gateway"  # which answers what no module does
_HEAD: Final = f"""# The wire

JSON-RPC 2.0 over TLS 1.3 where the robot has keys, over TCP on its own computer where it has none, or at its
Unix socket; protocol {PROTOCOL}: one message a line, in UTF-8, many requests and streams at once
over one connection. The gateway says nothing without being asked, apart from the notifications of streams.
Parameters forbid unknown fields; results may grow, so a reader ignores fields that it does not know.
Whatever is missing or stale is `null`. In Python, [`gateway.client`](../how-to/write-a-script.md) speaks it.

```json
{{"jsonrpc": "2.0", "id": 1, "method": "component.snapshot", "params": {{"channels": ["left_knee.*"]}}}}
```

*Module* says which part of the gateway answers; it is started by the first request, and stopped after the
last client has left. *Role*: the least that a client must be to ask, of viewer, operator and maintainer; a
robot may let operators reset and enable ([pair](../how-to/pair.md#what-a-role-may)). What is for maintainers
within a method for others: command lines in `resource.snapshot`, `take_over` in `control.acquire`. `hello`
says what one is and what that refuses. *lease*: only the client that holds it may ask. *urgent*: acts before
all that waits. *in turn*: devices or the kernel are asked, for one client after the other. What a client may
ask for is bounded: [limits](limits.md)."""
_STREAM: Final = f"""## Streams

`stream.start` answers with a number; then notifications `{STREAM_DATA}` come until `stream.stop` or the end
of the connection. A client that is slow loses its own rows, oldest first, and is told how many."""
_ERRORS: Final = """## Errors

An error has a message for people, which says what to do, and `data` with its kind for programs."""


def draw() -> str:
    """Return the page."""
    declared = list(METHODS.values())
    parts = [_HEAD, "## Methods", _overview(declared), *map(_section, declared)]
    parts += [_STREAM, _fields(StreamData), _ERRORS, _kinds(), _fields(ErrorData), "## Objects"]
    return "\n\n".join([*parts, *_objects(declared)]) + "\n"


def _overview(declared: list[AnyMethod]) -> str:
    lines = ["| method | module | role | | takes |", "|---|---|---|---|---|"]
    for one in declared:
        anchor = one.name.replace(".", "")
        known = ", ".join(word for word, holds in _words(one) if holds)
        module = one.module or SERVICE
        lines.append(f"| [`{one.name}`](#{anchor}) | {module} | {one.role} | {known} | {_parameters(one)} |")
    return "\n".join(lines)


def _words(method: AnyMethod) -> Iterator[tuple[str, bool]]:
    yield "lease", method.needs_lease
    yield "urgent", method.urgent
    yield "in turn", method.in_turn


def _parameters(method: AnyMethod) -> str:
    names = [f"**`{key.name}`**" if key.default is None else f"`{key.name}`" for key in sent(method.params)]
    return ", ".join(names) or "nothing"


def _section(method: AnyMethod) -> str:
    parts = [f"### `{method.name}`"]
    if any(sent(method.params)):
        parts += [docstring(method.params), table(sent(method.params), "takes")]
    if any(sent(method.result)):
        parts += [docstring(method.result), _fields(method.result)]
    else:
        parts.append("Gives nothing.")
    return "\n\n".join(filter(None, parts))


def _fields(struct: type[Struct]) -> str:
    rows = (f"| `{key.name}` | {key.kind} | {key.meaning} |" for key in sent(struct))
    return "\n".join(["| gives | type | meaning |", "|---|---|---|", *rows])


def _kinds() -> str:
    rows = (f"| `{kind.value}` | {code} |" for kind, code in CODES.items())
    return "\n".join(["| kind | code |", "|---|---|", *rows])


def _objects(declared: list[AnyMethod]) -> Iterator[str]:
    """Yield the structs that results are made of, by their names."""
    found: Mapping[str, type[Struct]] = {
        part.__name__: part
        for one in declared
        for whole in (one.params, one.result)
        for part in mentioned(whole)
    }
    for name, struct in sorted(found.items()):
        yield "\n\n".join(filter(None, [f"### {name}", docstring(struct), _fields(struct)]))
