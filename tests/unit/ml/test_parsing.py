"""Many threads at once: Python 3.11 breaks off those that parse, and warnings are the whole process's."""

import gc
import io
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning

from ml.benchmarks.arrays import Arrays
from ml.neural import fixed_epochs
from ml.parsing import TRIES, parsing
from ml.registry import archive
from ml.registry.code import _tree

THREADS, TIMES = 4, 25


class Circle:
    """Garbage whose end runs Python's own code, wherever the collector comes by: there threads take turns."""

    def __init__(self) -> None:
        self.me = self

    def __del__(self) -> None:
        sum(range(20))


@pytest.fixture(autouse=True)
def turns_are_short() -> Iterator[None]:
    interval_s, thresholds = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(50)
    yield
    gc.set_threshold(*thresholds)
    sys.setswitchinterval(interval_s)


def at_once(*calls: Callable[[], object]) -> list[BaseException]:
    """What goes wrong while each is done again and again, in several threads."""
    wrong: list[BaseException] = []

    def again(call: Callable[[], object]) -> None:
        for _ in range(TIMES):
            for _ in range(20):
                Circle()
            try:
                call()
            except Exception as error:  # noqa: BLE001 - whatever it is, it is what is asked for
                wrong.append(error)

    threads = [threading.Thread(target=again, args=(call,)) for call in calls * (THREADS // len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return wrong


def test_the_code_of_features_is_read_by_many_threads_at_once() -> None:
    assert at_once(lambda: _tree("ml.features.recipe")) == []


def test_a_sound_model_is_never_called_damaged(tmp_path: Path) -> None:
    model = archive.dump({"weights": np.arange(6.0), "names": ["a", "b"]})
    file = tmp_path / "arrays.npz"
    np.savez(file, x=np.zeros((2, 2)))
    wrong = at_once(lambda: archive.load(model), lambda: _tree("ml.features.recipe"), lambda: Arrays(file))
    assert wrong == []


def test_what_a_library_parses_meanwhile_is_tried_again() -> None:
    broken = iter([True] * (TRIES - 1))

    def call() -> str:
        if next(broken, False):
            raise SystemError("AST constructor recursion depth mismatch")
        return "read"

    assert parsing(call) == "read"


def test_what_is_always_broken_is_said() -> None:
    with pytest.raises(SystemError, match="always"):
        parsing(lambda: (_ for _ in ()).throw(SystemError("always")))


def test_what_is_read_may_read_something_else() -> None:
    assert parsing(lambda: parsing(lambda: np.load(_array()).tolist())) == [1.0]


def _array() -> io.BytesIO:
    held = io.BytesIO()
    np.save(held, np.array([1.0]))
    held.seek(0)
    return held


def test_no_thread_that_trains_gives_others_their_warnings_back_too_early() -> None:
    """The first one to end did, and a model of two epochs that another one trained failed."""
    within, ended = threading.Barrier(2), threading.Event()

    def trains() -> None:
        with fixed_epochs():
            within.wait()
            ended.wait()

    before = list(warnings.filters)
    other = threading.Thread(target=trains)
    other.start()
    try:
        with fixed_epochs():
            within.wait()
        assert warnings.filters[0][2] is ConvergenceWarning
    finally:
        ended.set()
    other.join()
    assert list(warnings.filters) == before


def test_trainings_within_another_and_beyond_its_end_keep_warnings_suppressed_to_the_last() -> None:
    """A generator of results may be begun by one thread and closed by another."""
    before = list(warnings.filters)
    outer, inner, last = ExitStack(), ExitStack(), ExitStack()
    for one in (outer, inner, last):
        one.enter_context(fixed_epochs())
    inner.close()
    assert warnings.filters[0][2] is ConvergenceWarning
    outer.close()
    assert warnings.filters[0][2] is ConvergenceWarning
    with ThreadPoolExecutor(1) as other:
        other.submit(last.close).result()
    assert list(warnings.filters) == before
