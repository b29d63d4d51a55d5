"""One life of the gateway: its real daemon, and people who ask it for things over their connections."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import msgspec

from gateway import config
from gateway.daemon import Daemon
from gateway.wire import framing
from gateway.wire.messages import METHODS
from tests.explore.net import Connection, Listener
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
    lost: bool = False  # nobody is there any more to take its answer
    result: Any = None
    error: framing.ErrorBody | None = None

    @property
    def kind(self) -> str | None:
        """Of the error that it was answered with."""
        return None if self.error is None or self.error.data is None else self.error.data.kind.value

    @property
    def outcome(self) -> dict[str, str]:
        """What the error says has become of each parameter."""
        return {} if self.error is None or self.error.data is None else self.error.data.outcome or {}


class Life:
    """From its start to its end or its kill."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.people: dict[str, Connection] = {}  # those who are connected
        self.asked: list[Asked] = []
        self.answered: Callable[[Asked], object] = lambda _asked: None
        self.cut: Callable[[str], object] = lambda _who: None  # told whose connection the gateway has ended
        self._numbers = itertools.count(1)
        self._listener = Listener(world.system)
        world.runtime.owner = self
        self._daemon = Daemon(config.load(world.file), cast("Any", self._listener))
        world.runtime.spawn("gateway", self._daemon.run)

    def module(self, name: str) -> Any:
        """The running module; `None` where it does not run."""
        return self._daemon._service.registry.running(name)

    @property
    def held(self) -> bool:
        """Whether a stop is held."""
        control = self.module("control")
        if control is None:
            return False
        return bool(control.authority.held if hasattr(control, "authority") else control.stop_held)

    def ask(self, who: str, method: str, **params: Any) -> Asked:
        """Send a request, over a new connection where there is none."""
        asked = Asked(next(self._numbers), who, method, params, self.world.runtime.now_ns)
        self.asked.append(asked)
        self.say(who, framing.encode_request(asked.number, method, params))
        return asked

    def say(self, who: str, lines: bytes) -> None:
        """Send whatever it is."""
        connection = self.people.get(who)
        if connection is None or connection.closed:
            connection = self.people[who] = self.connect(lambda: self.cut(who))
        connection.say(lines)

    def connect(self, cut: Callable[[], object] = bool) -> Connection:
        """Somebody comes; `cut` is told when the gateway ends it."""
        connection = Connection(self.world.system, self._hear, cut)
        self._listener.connect(connection)
        return connection

    def leave(self, who: str, *, gone: bool = True) -> None:
        """Close a person's connection; or say nothing more, and still take what comes."""
        connection = self.people.pop(who, None)
        if connection is not None:
            connection.end(gone=gone)

    def kill(self) -> None:
        """End it where it stands."""
        self.world.runtime.kill(self)
        self.world.disk.lose_process()
        for one in self.world.wires.values():
            one.disconnect()

    def _hear(self, data: bytes) -> None:
        for line in data.splitlines():
            if b'"id"' in line:
                self._answer(msgspec.json.decode(line, type=_Answer))

    def _answer(self, response: "_Answer") -> None:
        found = next((one for one in self.asked if one.number == response.id), None)
        if found is None or found.answered_ns is not None:
            return
        found.answered_ns = self.world.runtime.now_ns
        if isinstance(response.error, framing.ErrorBody):
            found.error = response.error
        elif isinstance(response.result, msgspec.Raw):
            found.result = msgspec.json.decode(response.result, type=METHODS[found.method].result)
        self.answered(found)


class _Answer(msgspec.Struct, frozen=True):
    """An answer to whatever was asked, with whatever id."""

    id: Any = None
    result: msgspec.Raw | msgspec.UnsetType = msgspec.UNSET
    error: framing.ErrorBody | msgspec.UnsetType = msgspec.UNSET
