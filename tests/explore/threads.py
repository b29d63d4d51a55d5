"""`threading`, `queue` and thread pools over the runtime: as the standard library says, but deterministic."""

import contextlib
import math
import queue
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from functools import partial
from types import SimpleNamespace, TracebackType
from typing import Any, Self

from tests.explore.runtime import Runtime, Task

NEVER = -1.0


class Fakes:
    """The namespaces that stand for those modules, all of one runtime."""

    def __init__(self, runtime: Runtime) -> None:
        _OnRuntime.runtime = runtime
        self.queue = SimpleNamespace(
            SimpleQueue=SimpleQueue, Queue=SimpleQueue, Empty=queue.Empty, Full=queue.Full
        )
        self.threading = SimpleNamespace(
            Lock=Lock,
            RLock=RLock,
            Condition=Condition,
            Event=Event,
            Thread=Thread,
            get_ident=lambda: id(runtime.current),
            get_native_id=lambda: id(runtime.current),
            current_thread=lambda: SimpleNamespace(name=getattr(runtime.current, "name", "hub"), ident=0),
            main_thread=lambda: None,
            TIMEOUT_MAX=threading.TIMEOUT_MAX,
        )


class _OnRuntime:
    """What knows the runtime. One process has one."""

    runtime: Runtime


def _ns(timeout_s: float | None) -> int | None:
    """Never 0 for a time that is left, however short: who waits for its end would wait for ever."""
    return None if timeout_s is None or timeout_s < 0 else math.ceil(timeout_s * 1e9)


class _Waiters(_OnRuntime):
    """Tasks that wait for the same, first come first served."""

    def __init__(self) -> None:
        self._tasks: deque[Task] = deque()

    def wait(self, timeout_ns: int | None) -> bool:
        if timeout_ns is not None and timeout_ns <= 0:
            return False
        task = self.runtime.current
        if task is None:
            raise RuntimeError("the hub waits for nobody")
        self._tasks.append(task)
        if self.runtime.block(timeout_ns):
            return True
        with contextlib.suppress(ValueError):  # somebody has tried to wake it in this very moment
            self._tasks.remove(task)
        return False

    def wake(self, count: int = 1) -> None:
        while self._tasks and count > 0:
            count -= self.runtime.wake(self._tasks.popleft())


class Lock(_OnRuntime):
    """`threading.Lock`; also re-entrant, where its class says so."""

    reentrant = False

    def __init__(self) -> None:
        self._owner: Task | str | None = None
        self._depth = 0
        self._waiters = _Waiters()

    def acquire(self, blocking: bool = True, timeout: float = NEVER) -> bool:
        runtime = self.runtime
        runtime.point()
        me = runtime.current or "hub"
        if self._owner is me and self.reentrant:
            self._depth += 1
            return True
        until_ns = self.runtime.end_of(_ns(timeout))
        while self._owner is not None:
            if not blocking or not self._waiters.wait(self.runtime.left_ns(until_ns)):
                return False
        self._owner, self._depth = me, 1
        return True

    def release(self) -> None:
        if self._owner is None:
            raise RuntimeError("release of a lock that nobody holds")
        self._depth -= 1
        if self._depth == 0:
            self._owner = None
            self._waiters.wake()

    def locked(self) -> bool:
        return self._owner is not None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()

    def give_up(self) -> int:
        """Release it wholly; how often it was held."""
        depth, self._depth = self._depth, 1
        self.release()
        return depth

    def take_again(self, depth: int) -> None:
        self.acquire()
        self._depth = depth


class RLock(Lock):
    """`threading.RLock`."""

    reentrant = True


class Condition(_OnRuntime):
    """`threading.Condition`."""

    def __init__(self, lock: Lock | None = None) -> None:
        self._lock = lock or RLock()
        self._waiters = _Waiters()
        self.acquire, self.release = self._lock.acquire, self._lock.release

    def __enter__(self) -> bool:
        return self._lock.acquire()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._lock.release()

    def wait(self, timeout: float | None = None) -> bool:
        depth = self._lock.give_up()
        try:
            return self._waiters.wait(_ns(timeout))
        finally:
            self._lock.take_again(depth)

    def wait_for(self, predicate: Callable[[], Any], timeout: float | None = None) -> Any:
        until_ns = self.runtime.end_of(_ns(timeout))
        while not (found := predicate()):
            left_ns = self.runtime.left_ns(until_ns)
            if not self.wait(None if left_ns is None else left_ns / 1e9):
                return predicate()
        return found

    def notify(self, n: int = 1) -> None:
        self._waiters.wake(n)

    def notify_all(self) -> None:
        self._waiters.wake(1 << 30)


class Event(_OnRuntime):
    """`threading.Event`."""

    def __init__(self) -> None:
        self._set = False
        self._waiters = _Waiters()

    def is_set(self) -> bool:
        return self._set

    def set(self) -> None:
        self._set = True
        self._waiters.wake(1 << 30)
        self.runtime.point()

    def clear(self) -> None:
        self._set = False

    def wait(self, timeout: float | None = None) -> bool:
        self.runtime.point()
        if not self._set:
            self._waiters.wait(_ns(timeout))
        return self._set


class Thread(_OnRuntime):
    """`threading.Thread`."""

    def __init__(
        self,
        group: None = None,
        target: Callable[..., object] | None = None,
        name: str | None = None,
        args: Sequence[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        *,
        daemon: bool | None = None,
    ) -> None:
        self.name = name or str(getattr(target, "__name__", "thread"))
        self.daemon = bool(daemon)
        self.ident: int | None = None
        self._work: Callable[[], object] = (
            self.run if target is None else partial(target, *args, **(kwargs or {}))
        )
        self._task: Task | None = None
        self._over = Event()

    def run(self) -> None:
        """For those that are made by inheritance."""

    def start(self) -> None:
        def work() -> None:
            try:
                self._work()
            finally:
                self._over.set()

        self._task = self.runtime.spawn(self.name, work)
        self.ident = id(self._task)
        self.runtime.point()

    def is_alive(self) -> bool:
        return self._task is not None and not self._over.is_set()

    def join(self, timeout: float | None = None) -> None:
        self._over.wait(timeout)


class SimpleQueue(_OnRuntime):
    """`queue.SimpleQueue`."""

    def __init__(self, maxsize: int = 0) -> None:
        self._items: deque[Any] = deque()
        self._waiters = _Waiters()

    def put(self, item: Any, block: bool = True, timeout: float | None = None) -> None:
        self._items.append(item)
        self._waiters.wake()
        self.runtime.point()

    put_nowait = put

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        self.runtime.point()
        until_ns = self.runtime.end_of(_ns(timeout))
        while not self._items:
            if not block or not self._waiters.wait(self.runtime.left_ns(until_ns)):
                raise queue.Empty
        return self._items.popleft()

    def get_nowait(self) -> Any:
        return self.get(block=False)

    def empty(self) -> bool:
        return not self._items

    def qsize(self) -> int:
        return len(self._items)


class ThreadPoolExecutor(_OnRuntime):
    """A pool of one thread, which is all that the gateway ever has."""

    def __init__(self, max_workers: int | None = None, thread_name_prefix: str = "", **_more: Any) -> None:
        if max_workers != 1:
            raise ValueError("only pools of one thread are known here")
        self._jobs = SimpleQueue()
        self._name = thread_name_prefix
        self._thread: Thread | None = None
        self._closed = False

    def submit(self, work: Callable[..., Any], /, *args: Any, **kwargs: Any) -> "Future[Any]":
        if self._closed:
            raise RuntimeError("cannot schedule new futures after shutdown")
        future: Future[Any] = Future()
        self._jobs.put((future, lambda: work(*args, **kwargs)))
        if self._thread is None:
            self._thread = Thread(target=self._serve, name=self._name)
            self._thread.start()
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        if not self._closed:
            self._closed = True
            self._jobs.put(None)
        if wait and self._thread is not None:
            self._thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.shutdown()

    def _serve(self) -> None:
        while (job := self._jobs.get()) is not None:
            future, work = job
            if not future.set_running_or_notify_cancel():
                continue
            try:
                result = work()
            except BaseException as error:  # noqa: BLE001 - as the standard library does
                future.set_exception(error)
            else:
                future.set_result(result)
