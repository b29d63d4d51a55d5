"""The process's memory: kept from the disk while drives can be stopped, and given back when it is free."""

import ctypes
import os
import resource
import threading

_CURRENT, _FUTURE, _ON_FAULT = 1, 2, 4  # mlockall(2), asm-generic/mman.h
_ALL = _CURRENT | _FUTURE | _ON_FAULT
_M_ARENA_MAX = -8  # mallopt(3)


def share_heap() -> None:
    """Let all threads take their memory from one heap; before the first of them begins.

    By default the C library makes several for each core, and what is free between what is kept in each of
    them is never given back: the process grew by a megabyte with each attack.
    """
    _call("mallopt", _M_ARENA_MAX, 1)


class MemoryLock:
    """Locked between the first `begin` and the last `end`: the lock belongs to the whole process."""

    problem: str | None = None  # why it is not locked, in words
    _lock = threading.Lock()
    _held = 0

    @classmethod
    def begin(cls) -> None:
        """Lock what is used now, and what is used from now on as soon as it is."""
        with cls._lock:
            if cls._held == 0:
                cls.problem = _call("mlockall", _ALL) if _is_allowed() else _LIMITED
            cls._held += 1

    @classmethod
    def give_back(cls) -> None:
        """Let the system have what is free within the process; for that a lock is lifted for a moment."""
        with cls._lock:
            is_locked = cls._held > 0 and cls.problem is None
            if is_locked:
                _call("munlockall")
            _call("malloc_trim", 0)
            if is_locked:
                cls.problem = _call("mlockall", _ALL)

    @classmethod
    def end(cls) -> None:
        with cls._lock:
            cls._held -= 1
            if cls._held == 0 and cls.problem is None:
                _call("munlockall")


_LIMITED = "memory is not locked: allow it with LimitMEMLOCK=infinity, or CAP_IPC_LOCK"


def _is_allowed() -> bool:
    """Return whether a lock is allowed: under a limit it would make later allocations fail instead."""
    soft, _hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    return soft == resource.RLIM_INFINITY or os.geteuid() == 0


def _call(name: str, *arguments: int) -> str | None:
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, name):  # malloc_trim is the GNU C library's
        return f"this system has no {name}"
    if getattr(libc, name)(*arguments) == 0:
        return None
    return f"memory is not locked ({os.strerror(ctypes.get_errno())})"
