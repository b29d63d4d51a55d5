"""Puts the runtime's own threads, time, disk and buses into every module of the gateway and the drivers."""

import concurrent.futures
import concurrent.futures._base as futures
import ctypes
import fcntl
import gc
import importlib
import os
import pkgutil
import queue
import select
import selectors
import sys
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import drivers
import eds
import gateway
from drivers.bus.interfaces import opening
from tests.explore.disk import Locking
from tests.explore.runtime import Runtime
from tests.explore.system import Poller, System
from tests.explore.threads import Fakes, ThreadPoolExecutor

UNDER_TEST = (gateway, drivers)
_NOT_LOADED = ("cli", "client", "resting", "main")  # programs, and what only clients run


def install(runtime: Runtime, system: System, open_transport: Callable[..., object]) -> None:
    """From now on nothing under test knows any other world. There is no way back in this process."""
    fakes = Fakes(runtime)
    instead: dict[int, Any] = {
        id(threading): fakes.threading,
        id(queue): fakes.queue,
        id(time): system.time,
        id(os): system.os,
        id(selectors): system.selectors,
        id(getattr(select, "epoll", None)): Poller,
        id(ctypes): SimpleNamespace(CDLL=_Libc, get_errno=lambda: 0),  # no memory is locked here
        id(fcntl): Locking,
        id(gc): SimpleNamespace(
            collect=_nothing, freeze=_nothing, unfreeze=_nothing
        ),  # it would copy all pages
        id(concurrent.futures.ThreadPoolExecutor): ThreadPoolExecutor,
        id(opening.open_transport): open_transport,
        id(eds.load): _loading_once(),
    }
    vars(futures)["threading"] = fakes.threading
    for package in UNDER_TEST:
        _load_all(package.__name__, package.__path__)
    for name, module in tuple(sys.modules.items()):
        if name.split(".")[0] in {package.__name__ for package in UNDER_TEST}:
            for key, value in tuple(vars(module).items()):
                if id(value) in instead:
                    setattr(module, key, instead[id(value)])
    eds.load = instead[id(eds.load)]


def _nothing() -> None:
    """Done elsewhere."""


class _Libc:
    """As much of the C library as is asked for."""

    def __init__(self, *_name: object, **_options: object) -> None:
        self.mlockall = self.munlockall = lambda *_flags: 0


def _load_all(name: str, path: Any) -> None:
    """What is imported later would find the real modules."""
    for found in pkgutil.iter_modules(path):
        if found.name in _NOT_LOADED:
            continue
        module = importlib.import_module(f"{name}.{found.name}")
        if found.ispkg:
            _load_all(module.__name__, module.__path__)


def _loading_once() -> Callable[..., Any]:
    """A restart reads the same files again: that must not take its time."""
    known: dict[Any, Any] = {}
    load = eds.load

    def load_once(path: Any, node_id: int) -> Any:
        if (path, node_id) not in known:
            known[path, node_id] = load(path, node_id)
        return known[path, node_id]

    return load_once
