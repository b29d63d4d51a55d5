"""What the gateway asks of the operating system: pipes, readiness, descriptors, and the time."""

import math
import os
import select
import selectors
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

from tests.explore.disk import Disk, DiskPath
from tests.explore.runtime import Runtime, Task

READ, WRITE = select.POLLIN, select.POLLOUT


class Channel:
    """Something that can become ready: a pipe, a listening socket, a connection. Its number stands for it."""

    def __init__(self, system: "System") -> None:
        self._number = system.numbered(self)
        self._pollers: list[Poller] = []

    @property
    def events(self) -> int:
        """What it is ready for now."""
        return 0

    def fileno(self) -> int:
        return self._number

    def changed(self) -> None:
        """It may be ready for something else now."""
        for poller in self._pollers:
            poller.look()

    def watched(self, poller: "Poller", *, on: bool) -> None:
        if on and poller not in self._pollers:
            self._pollers.append(poller)
        elif not on and poller in self._pollers:
            self._pollers.remove(poller)


class Pipe(Channel):
    """Both ends of one."""

    def __init__(self, system: "System") -> None:
        super().__init__(system)
        self._bytes = b""

    @property
    def events(self) -> int:
        return READ if self._bytes else 0

    def read(self, size: int) -> bytes:
        if not self._bytes:
            raise BlockingIOError
        taken, self._bytes = self._bytes[:size], self._bytes[size:]
        return taken

    def write(self, data: bytes) -> int:
        self._bytes += data
        self.changed()
        return len(data)


class Poller:
    """`select.epoll`."""

    runtime: Runtime
    system: "System"

    def __init__(self) -> None:
        self._wanted: dict[int, int] = {}
        self._waiting: Task | None = None

    def register(self, descriptor: int, events: int) -> None:
        self._wanted[descriptor] = events
        self.system.channel(descriptor).watched(self, on=True)

    modify = register

    def unregister(self, descriptor: int) -> None:
        del self._wanted[descriptor]
        self.system.channel(descriptor).watched(self, on=False)

    def poll(self, timeout: float | None = None) -> list[tuple[int, int]]:
        self.runtime.point()
        found = self._ready()
        if not found and (timeout is None or timeout > 0):
            self._waiting = self.runtime.current
            self.runtime.block(None if timeout is None else math.ceil(timeout * 1e9))
            self._waiting = None
            found = self._ready()
        return found

    def look(self) -> None:
        if self._waiting is not None and self._ready():
            self.runtime.wake(self._waiting)

    def close(self) -> None:
        for descriptor in tuple(self._wanted):
            self.unregister(descriptor)

    def _ready(self) -> list[tuple[int, int]]:
        channel = self.system.channel
        now = ((one, wanted & channel(one).events) for one, wanted in self._wanted.items())
        return [(one, events) for one, events in now if events]


class Selector:
    """`selectors.DefaultSelector`, whose events are named otherwise."""

    def __init__(self) -> None:
        self._poller = Poller()
        self._data: dict[int, Any] = {}
        self.close = self._poller.close

    def register(self, file: Any, events: int, data: Any = None) -> None:
        self._data[_number(file)] = data
        read, write = events & selectors.EVENT_READ, events & selectors.EVENT_WRITE
        self._poller.register(_number(file), READ * bool(read) | WRITE * bool(write))

    modify = register

    def unregister(self, file: Any) -> None:
        self._poller.unregister(_number(file))
        del self._data[_number(file)]

    def get_map(self) -> "Selector":
        return self

    def __contains__(self, file: Any) -> bool:
        return _number(file) in self._data

    def select(self, timeout: float | None = None) -> list[tuple[SimpleNamespace, int]]:
        return [(self._key(one), _events(events)) for one, events in self._poller.poll(timeout)]

    def _key(self, descriptor: int) -> SimpleNamespace:
        return SimpleNamespace(data=self._data[descriptor])


def _number(file: Any) -> int:
    return file if isinstance(file, int) else int(file.fileno())


def _events(events: int) -> int:
    return selectors.EVENT_READ * bool(events & READ) | selectors.EVENT_WRITE * bool(events & WRITE)


_FIRST = 5000  # descriptor


class System:
    """`os`, `selectors` and `time` for the code under test; what stands nowhere here is the real one's."""

    def __init__(self, runtime: Runtime, disk: Disk) -> None:
        self.runtime, self.disk = runtime, disk
        self._channels: list[Channel] = []
        Poller.runtime, Poller.system = runtime, self
        self.selectors = SimpleNamespace(
            DefaultSelector=Selector, EVENT_READ=selectors.EVENT_READ, EVENT_WRITE=selectors.EVENT_WRITE
        )
        self.os = _Over(
            os,
            pipe=self._pipe,
            read=self._read,
            write=self._write,
            set_blocking=lambda _descriptor, _blocking: None,
            open=self._open,
            close=self._close,
            fsync=disk.sync,
            ftruncate=disk.truncate,
            statvfs=disk.room,
            sched_setscheduler=lambda *_policy: None,
        )
        self.time = _Over(time, **self._clocks())

    def numbered(self, channel: Channel) -> int:
        self._channels.append(channel)
        return _FIRST + len(self._channels) - 1

    def channel(self, descriptor: int) -> Channel:
        return self._channels[descriptor - _FIRST]

    def _clocks(self) -> dict[str, Callable[..., Any]]:
        runtime = self.runtime
        since_1970_ns = 1_780_000_000_000_000_000
        return {
            "monotonic": lambda: runtime.now_ns / 1e9,
            "monotonic_ns": lambda: runtime.now_ns,
            "perf_counter": lambda: runtime.now_ns / 1e9,
            "perf_counter_ns": lambda: runtime.now_ns,
            "time": lambda: (runtime.now_ns + since_1970_ns) / 1e9,
            "time_ns": lambda: runtime.now_ns + since_1970_ns,
            "thread_time_ns": lambda: 0,
            "process_time": lambda: 0.0,
            "sleep": self._sleep,
        }

    def _sleep(self, seconds: float) -> None:
        if seconds > 0:
            self.runtime.block(math.ceil(seconds * 1e9))
        else:
            self.runtime.point()

    def _pipe(self) -> tuple[int, int]:
        """Both ends are one channel."""
        number = Pipe(self).fileno()
        return number, number

    def _read(self, descriptor: int, size: int) -> bytes:
        return cast("Pipe", self.channel(descriptor)).read(size)

    def _write(self, descriptor: int, data: bytes) -> int:
        written = cast("Pipe", self.channel(descriptor)).write(data)
        self.runtime.point()
        return written

    def _open(self, path: Any, flags: int, *more: Any) -> int:
        if isinstance(path, DiskPath):
            return self.disk.opened(str(path))
        return os.open(path, flags, *more)

    def _close(self, descriptor: int) -> None:
        self.disk.closed(descriptor)


class _Over:
    """A module with some of its functions replaced."""

    def __init__(self, module: Any, **replaced: Any) -> None:
        self._module = module
        self.__dict__.update(replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)
