"""What the gateway asks of the operating system: pipes, readiness, descriptors, and the time."""

import os
import selectors
import time
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

from tests.explore.disk import Disk, DiskPath
from tests.explore.runtime import Runtime, Task

Ready = tuple[SimpleNamespace, int]


class Channel:
    """Something that can become ready to be read: a pipe, or a client's connection."""

    def __init__(self) -> None:
        self.items: list[Any] = []
        self.pollers: set[Poller] = set()

    def put(self, item: Any) -> None:
        self.items.append(item)
        for poller in self.pollers:
            poller.look()

    def take(self) -> list[Any]:
        taken, self.items = self.items, []
        return taken


class Poller:
    """`selectors.DefaultSelector`: everything is ready to be written, and to be read where something came."""

    runtime: Runtime
    system: "System"

    def __init__(self) -> None:
        self._keys: dict[Any, tuple[Channel, int, Any]] = {}
        self._waiting: Task | None = None

    def register(self, file: Any, events: int, data: Any = None) -> None:
        channel = self.system.channel(file)
        self._keys[file] = (channel, events, data)
        channel.pollers.add(self)
        self.look()

    def modify(self, file: Any, events: int, data: Any = None) -> None:
        self.register(file, events, data)

    def unregister(self, file: Any) -> None:
        channel, _, _ = self._keys.pop(file)
        channel.pollers.discard(self)

    def get_map(self) -> Mapping[Any, object]:
        return self._keys

    def select(self, timeout: float | None = None) -> list[Ready]:
        self.runtime.point()
        found = self._ready()
        if not found and (timeout is None or timeout > 0):
            self._waiting = self.runtime.current
            self.runtime.block(None if timeout is None else round(timeout * 1e9))
            self._waiting = None
            found = self._ready()
        return found

    def look(self) -> None:
        if self._waiting is not None:
            self.runtime.wake(self._waiting)

    def close(self) -> None:
        for file in tuple(self._keys):
            self.unregister(file)

    def _ready(self) -> list[Ready]:
        found = []
        for channel, events, data in self._keys.values():
            now = events & selectors.EVENT_WRITE | (events & selectors.EVENT_READ if channel.items else 0)
            if now:
                found.append((SimpleNamespace(data=data), now))
        return found


class System:
    """`os`, `selectors` and `time` for the code under test; what stands nowhere here is the real one's."""

    def __init__(self, runtime: Runtime, disk: Disk) -> None:
        self.runtime, self.disk = runtime, disk
        self._channels: dict[int, Channel] = {}
        self._next = 5000
        Poller.runtime, Poller.system = runtime, self
        self.selectors = SimpleNamespace(
            DefaultSelector=Poller, EVENT_READ=selectors.EVENT_READ, EVENT_WRITE=selectors.EVENT_WRITE
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
        )
        self.time = _Over(time, **self._clocks())

    def channel(self, file: Any) -> Channel:
        return file if isinstance(file, Channel) else self._channels[file]

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
            self.runtime.block(round(seconds * 1e9))
        else:
            self.runtime.point()

    def _pipe(self) -> tuple[int, int]:
        """Both ends are one channel."""
        self._next += 2
        self._channels[self._next] = self._channels[self._next + 1] = Channel()
        return self._next, self._next + 1

    def _read(self, descriptor: int, _size: int) -> bytes:
        taken = self._channels[descriptor].take()
        if not taken:
            raise BlockingIOError
        return b"".join(taken)

    def _write(self, descriptor: int, data: bytes) -> int:
        self._channels[descriptor].put(data)
        self.runtime.point()
        return len(data)

    def _open(self, path: Any, flags: int, *more: Any) -> int:
        if isinstance(path, DiskPath):
            return self.disk.opened(str(path))
        return os.open(path, flags, *more)

    def _close(self, descriptor: int) -> None:
        self._channels.pop(descriptor, None)
        self.disk.closed(descriptor)


class _Over:
    """A module with some of its functions replaced."""

    def __init__(self, module: Any, **replaced: Any) -> None:
        self._module = module
        self.__dict__.update(replaced)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._module, name)
