"""The client's methods: each of the wire is asked with what it takes, blocking and with asyncio alike."""

import asyncio
import inspect
from typing import Any, get_type_hints

import pytest

from gateway.client import Client, Robot
from gateway.client import link as links
from gateway.wire.method import AnyMethod, Method
from gateway.wire.methods import METHODS

UNUSED = {"parameter.list"}  # what is known without asking, which no program of ours needs
OF_THE_LINK = {"hello", "clock.read", "stream.start", "stream.stop"}
ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "write": ({"gait.step_length": 0.42},),
    "confirm": (1,),
    "revert": (1,),
    "store": ("gait",),
    "restore": ("gait",),
    "objects": ("gait",),
    "read_objects": ("gait", "0x2001:0"),
    "stop": ("test",),
}
# What asyncio has and blocking calls do by themselves, or in another form.
WITHIN = {"acquire", "release", "writing", "subscribe"}


def _asking() -> list[str]:
    """The client's methods that ask one thing."""
    found = inspect.getmembers(Client, inspect.iscoroutinefunction)
    return [name for name, _ in found if not name.startswith("_") and name != "close"]


class _Asked:
    """A link that writes down what it is asked."""

    def __init__(self) -> None:
        self.calls: list[tuple[AnyMethod, Any]] = []

    async def call(self, method: AnyMethod, params: Any, timeout_s: float | None = None) -> Any:
        self.calls.append((method, params))


@pytest.mark.parametrize("name", _asking())
def test_a_call_asks_one_method_with_its_parameters_for_its_result(name: str) -> None:
    client, asked = Client("127.0.0.1:7420"), _Asked()
    client.link = asked  # type: ignore[assignment]
    asyncio.run(getattr(client, name)(*ARGUMENTS.get(name, ())))
    [(method, params)] = asked.calls
    assert type(params) is method.params
    told = get_type_hints(getattr(Client, name))["return"]
    assert told in (method.result, type(None))


def test_every_method_has_its_call() -> None:
    client, asked = Client("127.0.0.1:7420"), _Asked()
    client.link = asked  # type: ignore[assignment]
    for name in _asking():
        asyncio.run(getattr(client, name)(*ARGUMENTS.get(name, ())))
    names = [method.name for method, _ in asked.calls]
    assert sorted(names) == sorted(set(METHODS) - UNUSED - OF_THE_LINK)
    of_the_link = {one.name for one in vars(links).values() if isinstance(one, Method)}
    assert of_the_link == OF_THE_LINK


@pytest.mark.parametrize("name", sorted(set(_asking()) - WITHIN))
def test_blocking_calls_take_and_give_the_same(name: str) -> None:
    ours, theirs = inspect.signature(getattr(Robot, name)), inspect.signature(getattr(Client, name))
    assert ours.return_annotation == theirs.return_annotation
    wanted = [one for one in theirs.parameters.values() if one.name != "trial_s"]  # has a block of its own
    assert [str(one) for one in ours.parameters.values()] == [str(one) for one in wanted]


def test_blocking_calls_are_there_for_all() -> None:
    public = {name for name, one in inspect.getmembers(Client, callable) if not name.startswith("_")}
    assert public - WITHIN <= {name for name, _ in inspect.getmembers(Robot, callable)}
