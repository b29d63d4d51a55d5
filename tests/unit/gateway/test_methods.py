"""Each method of the wire stands once, is answered once as it says, and looks to others as it always has."""

import importlib
import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast, get_type_hints

import msgspec
import pytest

from gateway.connections import stop_lines
from gateway.connections.fair_queue import FairQueue
from gateway.connections.session import Session
from gateway.handlers import Handlers, on
from gateway.process.loop import Loop
from gateway.registry import MODULES, Context
from gateway.service import Service
from gateway.wire import framing
from gateway.wire.control import CONTROL_ACQUIRE, Lease
from gateway.wire.method import AnyMethod, Done, Params
from gateway.wire.methods import METHODS
from gateway.wire.stop import ROBOT_RESET, Reset
from gateway.wire.stream import StreamData
from tests.unit.gateway.harness import HEAD, Answered, Bench, Client, config

CONTRACT = Path(__file__).with_name("wire_contract.json")
NAMES_OF_HANDLERS = {"Session": Session, "Future": Future, "msgspec": msgspec}
EXAMPLES: dict[str, dict[str, Any]] = {
    "hello": {"client": "test"},
    "stream.start": {"modules": ["component"], "rate_hz": 1},
    "stream.stop": {"stream": 1},
    "control.acquire": {"ttl_s": 10},
    "parameter.write": {"changes": {"gait.step_length": 0.42}},
    "parameter.confirm": {"write": 1},
    "parameter.revert": {"write": 1},
    "parameter.store": {"component": "gait"},
    "parameter.restore": {"component": "gait"},
    "object.list": {"component": "gait", "search": "0x2001"},
    "object.read": {"component": "gait", "objects": ["0x2001:0"]},
}


@pytest.fixture
def handlers(tmp_path: Path) -> Iterator[dict[str | None, Handlers]]:
    """Those of every module, and of the gateway itself, by the module."""
    robot, loop = config(tmp_path, HEAD), Loop()
    service = Service(robot, loop)
    needs = cast("dict[str, Any]", dict.fromkeys(MODULES, SimpleNamespace()))
    found: dict[str | None, Handlers] = {None: service.handlers}
    for name, spec in MODULES.items():
        path, _, class_name = spec.path.partition(":")
        module = getattr(importlib.import_module(path), class_name)
        found[name] = module(Context(robot, loop, needs, lambda _on: None)).handlers
    yield found
    loop.close()


def test_each_method_is_answered_once_by_the_module_that_it_names(
    handlers: dict[str | None, Handlers],
) -> None:
    answered = [(name, module) for module, some in handlers.items() for name in some.names]
    assert sorted(answered) == sorted((one.name, one.module) for one in METHODS.values())


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_handler_takes_and_gives_what_its_method_says(
    handlers: dict[str | None, Handlers], method: AnyMethod
) -> None:
    handler = handlers[method.module]._by_name[method.name]
    hints = get_type_hints(handler, localns=NAMES_OF_HANDLERS)
    given = hints.pop("return")
    assert list(hints.values()) == [Session, method.params]
    assert given in (method.result, Future[method.result], Future[msgspec.Raw])  # type: ignore[name-defined]


def test_no_method_has_two_handlers_nor_a_lease_that_nobody_looks_for() -> None:
    def lease(_session: Session, _params: Any) -> Any:
        return Lease("", 0.0)

    def reset(_session: Session, _params: Params) -> Reset:
        return Reset({}, {}, held=False)

    with pytest.raises(ValueError, match="two handlers"):
        Handlers(on(CONTROL_ACQUIRE, lease), on(CONTROL_ACQUIRE, lease))
    with pytest.raises(ValueError, match="lease"):
        Handlers(on(ROBOT_RESET, reset))


def test_what_needs_the_lease_is_refused_without_it_and_nothing_else(
    bench: Bench, connect: Callable[[], Client]
) -> None:
    client = connect()
    refused = set()
    for name in METHODS:
        if asked(client, name) == "no_lease":
            refused.add(name)
        if name == CONTROL_ACQUIRE.name:
            client.call("control.release")
    assert refused == {one.name for one in METHODS.values() if one.needs_lease}


def test_what_asks_devices_or_the_kernel_does_so_in_turn(
    bench: Bench, connect: Callable[[], Client], monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[str] = []
    add = FairQueue.add

    def recorded(turns: Any, client: Any, item: Any) -> None:
        waited.append(current)
        add(turns, client, item)

    monkeypatch.setattr(FairQueue, "add", recorded)
    client = connect()
    in_turn = set()
    for current in METHODS:
        waited.clear()
        asked(client, current)
        in_turn |= set(waited)
    assert in_turn == {one.name for one in METHODS.values() if one.in_turn}


def asked(client: Client, name: str) -> str | None:
    """Ask, and wait for what is answered: the kind of error, or `None`."""
    try:
        client.call(name, **EXAMPLES.get(name, {}))
    except Answered as error:
        return error.kind
    return None


def test_the_one_urgent_method_is_the_stop_that_lines_are_searched_for() -> None:
    assert [one.name for one in METHODS.values() if one.urgent] == [stop_lines.STOP]


def test_modules_and_names_are_known() -> None:
    assert {one.module for one in METHODS.values()} <= {None, *MODULES}
    assert all(name == one.name for name, one in METHODS.items())


def test_the_contract_is_as_it_was_published() -> None:
    """Programs of others rely on what stands in that file: only to results may fields be added.

    To parameters only what can be left out, and then means what it meant before.
    """
    found = _contract()
    known = json.loads(CONTRACT.read_text(encoding="utf-8"))
    assert found["methods"] == known["methods"]
    assert {name: json.dumps(one) for name, one in found["structs"].items()} == {
        name: json.dumps(one) for name, one in known["structs"].items()
    }  # also in the order of their fields


def test_results_without_fields_are_empty_objects() -> None:
    assert framing.encode_result(1, Done()) == b'{"id":1,"result":{},"jsonrpc":"2.0"}\n'


def _contract() -> dict[str, dict[str, Any]]:
    """Every method, and every struct as its JSON schema without our words."""
    types = [kind for one in METHODS.values() for kind in (one.params, one.result)]
    schemas, structs = msgspec.json.schema_components([*types, StreamData])
    names = iter(str(schema["$ref"]).rpartition("/")[2] for schema in schemas)
    return {
        "methods": {
            name: {"params": next(names), "result": next(names), "needs_lease": one.needs_lease}
            for name, one in METHODS.items()
        },
        "structs": _without_words(structs),
    }


def _without_words(schema: Any) -> Any:
    if isinstance(schema, dict):
        return {key: _without_words(one) for key, one in schema.items() if key != "description"}
    return [_without_words(one) for one in schema] if isinstance(schema, list) else schema
