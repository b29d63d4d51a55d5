"""One life of the gateway: its real service over its real loop, and people who ask it for things."""

import itertools
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

import msgspec

from gateway import config, wire
from gateway.loop import Loop
from gateway.service import Service
from tests.explore.system import Channel
from tests.explore.world import World


@dataclass(slots=True, eq=False)
class Asked:
    """One request and, when it is there, its answer."""

    number: int
    who: str
    method: str
    params: dict[str, Any]
    asked_ns: int
    answered_ns: int | None = None
    result: Any = None
    error: wire.RpcError | None = None

    @property
    def kind(self) -> str | None:
        """Of the error that it was answered with."""
        return None if self.error is None else self.error.kind.value


class Person:
    """One client's connection, as far as the gateway's modules know it."""

    def __init__(self, life: "Life", name: str) -> None:
        self.peer = name
        self.who = name
        self.closed = False
        self.cpu_ns = 0
        self.outlets: dict[int, Any] = {}
        self._life = life
        self._farewells: list[Callable[[], None]] = []

    def on_close(self, farewell: Callable[[], None]) -> None:
        self._farewells.append(farewell)

    def close(self) -> None:
        """The connection has ended. In the loop."""
        if not self.closed:
            self.closed = True
            for farewell in self._farewells:
                farewell()


class Life:
    """From its start to its end or its kill."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.people: dict[str, Person] = {}
        self.asked: list[Asked] = []
        self.answered: Callable[[Asked], object] = lambda _asked: None
        self._numbers = itertools.count(1)
        self._arrivals = Channel()
        runtime = world.runtime
        runtime.owner = self
        self.loop = Loop()
        self.service = Service(config.load(world.file), self.loop)
        self.loop.watch(self._arrivals, 1, lambda _events: self._take())
        self.loop.post(self.service.resume)
        runtime.spawn("loop", self.loop.run)

    def module(self, name: str) -> Any:
        """The running module; `None` where it does not run."""
        return self.service.registry.running(name)

    def ask(self, who: str, method: str, **params: Any) -> Asked:
        """Send a request; it comes with the loop's next turn."""
        now_ns = self.world.runtime.now_ns
        asked = Asked(next(self._numbers), who, method, params, now_ns)
        self.asked.append(asked)
        self._arrivals.put(lambda: self._handle(asked))
        return asked

    def leave(self, who: str) -> None:
        """Close a person's connection."""
        person = self.people.pop(who, None)
        if person is not None:
            self._arrivals.put(person.close)

    def kill(self) -> None:
        """End it where it stands."""
        self.world.runtime.kill(self)
        self.world.disk.lose_process()
        for one in self.world.wires.values():
            one.disconnect()

    def _take(self) -> None:
        for arrival in self._arrivals.take():
            arrival()

    def _person(self, name: str) -> Person:
        person = self.people.get(name)
        if person is None:
            person = self.people[name] = Person(self, name)
            self.service.opened(person)  # type: ignore[arg-type]
        return person

    def _handle(self, asked: Asked) -> None:
        params = msgspec.Raw(msgspec.json.encode(asked.params))
        request = wire.Request("2.0", asked.method, params, asked.number)
        try:
            answer = self.service.handle(self._person(asked.who), request)  # type: ignore[arg-type]
        except wire.RpcError as error:
            self._tell(asked, None, error)
            return
        if isinstance(answer, Future):
            answer.add_done_callback(lambda done: self.loop.call(lambda: self._complete(asked, done)))
        else:
            self._tell(asked, answer, None)

    def _complete(self, asked: Asked, done: "Future[object]") -> None:
        error = done.exception()
        if error is None:
            self._tell(asked, done.result(), None)
        elif isinstance(error, wire.RpcError):
            self._tell(asked, None, error)
        else:
            raise error

    def _tell(self, asked: Asked, result: Any, error: wire.RpcError | None) -> None:
        asked.answered_ns = self.world.runtime.now_ns
        asked.result, asked.error = result, error
        self.answered(asked)
