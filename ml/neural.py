"""Common parts of neural networks: scaling and training."""

import threading
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from sklearn.exceptions import ConvergenceWarning
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

FAR: Final = 5.0  # standard deviations, beyond which a feature says no more
_counting = threading.Lock()
_training: list[None] = []  # as long as something trains
_restored = ExitStack()  # the process's warnings, by whoever trains last


def scaled(*steps: Any) -> Pipeline:
    """Return features in standard deviations, none far out; then `steps`."""
    return make_pipeline(StandardScaler(), FunctionTransformer(within), *steps)


@contextmanager
def fixed_epochs() -> Iterator[None]:
    """Suppress convergence warnings: the network stops after the tuned number of epochs.

    Warnings are the whole process's: they are suppressed from the first thread that trains to the last.
    """
    with _counting:
        if not _training:
            _restored.enter_context(warnings.catch_warnings())
            warnings.simplefilter("ignore", ConvergenceWarning)
        _training.append(None)
    try:
        yield
    finally:
        with _counting:
            _training.pop()
            if not _training:
                _restored.close()


def within(x: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """None farther out than FAR."""
    near: npt.NDArray[Any] = np.clip(x, -FAR, FAR)
    return near
