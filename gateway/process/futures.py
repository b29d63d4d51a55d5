"""Putting together results that come later, from other threads."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any, TypeVar, overload

from gateway.process.loop import Loop

T = TypeVar("T")
R = TypeVar("R")


def done(result: T) -> "Future[T]":
    """Return a future that has its result already."""
    future: Future[T] = Future()
    future.set_result(result)
    return future


def failed(error: BaseException) -> "Future[T]":
    """Return a future that has failed already."""
    future: Future[T] = Future()
    future.set_exception(error)
    return future


def outcome(finished: "Future[T]") -> "T | Exception":
    """Return the outcome of a finished future: its result, or its error (including cancellation)."""
    try:
        return finished.result()
    except Exception as error:  # noqa: BLE001 - it is handed on, not handled
        return error


@overload
def then(first: "Future[T]", continue_: "Callable[[T], Future[R]]") -> "Future[R]": ...


@overload
def then(first: "Future[T]", continue_: Callable[[T], R]) -> "Future[R]": ...


def then(first: "Future[T]", continue_: Callable[[T], Any]) -> "Future[Any]":
    """Return the future of `continue_`, applied to the result of `first` in the thread that sets it.

    Errors pass through.
    """
    result: Future[Any] = Future()

    def on_first(finished: "Future[T]") -> None:
        try:
            following = continue_(finished.result())
        except Exception as error:  # noqa: BLE001 - every error belongs to the one who waits
            result.set_exception(error)
        else:
            _settle(result, following)

    first.add_done_callback(on_first)
    return result


def gather(futures: "Mapping[str, Future[T]]") -> "Future[dict[str, T | Exception]]":
    """All results by name, once the last is there; an error stands in its place as itself."""
    names = tuple(futures)  # and not the futures, whose callbacks would hold themselves then
    results: dict[str, T | Exception] = {}
    everything: Future[dict[str, T | Exception]] = Future()
    lock = threading.Lock()

    def collect(name: str, finished: "Future[T]") -> None:
        found = outcome(finished)
        with lock:
            results[name] = found
            complete = len(results) == len(names)
        if complete:
            everything.set_result({name: results[name] for name in names})

    if not futures:
        everything.set_result({})
    for name, future in futures.items():
        future.add_done_callback(lambda finished, name=name: collect(name, finished))  # type: ignore[misc]
    return everything


def pass_on(finished: "Future[R]", result: "Future[R]") -> None:
    """Give a future what another one, that is finished, holds."""
    found = outcome(finished)
    if isinstance(found, Exception):
        result.set_exception(found)
    else:
        result.set_result(found)


def _settle(result: "Future[R]", following: "R | Future[R]") -> None:
    if isinstance(following, Future):
        following.add_done_callback(lambda finished: pass_on(finished, result))
    else:
        result.set_result(following)


def back(loop: Loop, future: "Future[T]") -> "Future[T]":
    """Return the same outcome, but given in the loop's thread, and so is whatever follows from it."""
    result: Future[T] = Future()
    future.add_done_callback(lambda done: loop.call(lambda: _settle(result, done)))
    return result


def within(loop: Loop, future: "Future[T]", seconds: float, otherwise: T) -> "Future[T]":
    """Return the result of `future`, or `otherwise` when that takes longer. For the loop's thread."""
    result: Future[T] = Future()

    def settle() -> None:
        if not result.done():
            timer.cancel()
            _settle(result, future if future.done() else otherwise)

    timer = loop.call_later(seconds, settle)
    future.add_done_callback(lambda _future: loop.call(settle))
    return result
