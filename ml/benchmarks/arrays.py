"""Reading a .npz file of recordings: the arrays that are needed, in SI units, and nothing unchecked."""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.errors import UnusableData
from ml.parsing import parsing

Array = npt.NDArray[Any]
GRAVITY_RANGE: Final = (8.5, 11.5)  # m/s²: the median length of what an accelerometer on a person measures


def _arrays(path: Path) -> dict[str, Array]:
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


class Arrays:
    """The arrays of a file by name; a pickle in it is never loaded."""

    def __init__(self, path: Path) -> None:
        """Read every array.

        Raises:
            UnusableData: it is no .npz file, or has objects in it.

        """
        self.path = path
        try:
            self._arrays = parsing(lambda: _arrays(path))
        except FileNotFoundError:
            raise
        except (ValueError, OSError, EOFError, AttributeError, TypeError, zipfile.BadZipFile) as error:
            raise UnusableData(f"{path} is no .npz file of plain arrays: {error}") from error

    def of(self, name: str, dimensions: int, rows: int | None = None) -> Array:
        """Return the array `name`.

        Raises:
            UnusableData: it is not there, or has another shape than asked for.

        """
        if name not in self._arrays:
            raise self.problem(f"has no array {name!r}; it has {', '.join(sorted(self._arrays))}")
        array = self._arrays[name]
        if array.ndim != dimensions or (rows is not None and len(array) != rows):
            wanted = f"{dimensions} dimensions" + ("" if rows is None else f" and {rows} rows")
            raise self.problem(f"{name!r} has the shape {array.shape}; expected are {wanted}")
        checked: Array = array
        return checked

    def rate(self, hz: int) -> None:
        """Check the sampling rate."""
        rate = self.of("rate", 0)
        if rate != hz:
            raise self.problem(f"was sampled at {rate} Hz; this benchmark's features are for {hz} Hz")

    def columns(self, channels: Sequence[str]) -> list[int]:
        """Return the places of these channels in `x`."""
        there = [str(name) for name in self.of("channels", 1)]
        if missing := [name for name in channels if name not in there]:
            raise self.problem(f"lacks the channels {', '.join(missing)}; it has {', '.join(there)}")
        return [there.index(name) for name in channels]

    def samples(self, channels: Sequence[str]) -> npt.NDArray[np.float64]:
        """(rows, channels) of `x * scale`, finite.

        Raises:
            UnusableData: a channel is missing, or a sample is not a number.

        """
        x, columns = self.of("x", 2), self.columns(channels)
        scale = self.of("scale", 1, x.shape[1])
        samples: npt.NDArray[np.float64] = x[:, columns] * scale[columns]
        self.finite(samples)
        return samples

    def flags(self, name: str, shape: tuple[int, ...]) -> npt.NDArray[np.bool_]:
        """Return the array `name` of this shape as yes or no; no everywhere where the file does not say.

        Raises:
            UnusableData: it has another shape.

        """
        if name not in self._arrays:
            return np.zeros(shape, dtype=bool)
        flags = self._arrays[name]
        if flags.shape != shape:
            raise self.problem(f"{name!r} has the shape {flags.shape}; expected is {shape}")
        said: npt.NDArray[np.bool_] = flags != 0
        return said

    def finite(self, samples: npt.NDArray[np.float64]) -> None:
        """Refuse what is not a number."""
        if not len(samples):
            raise self.problem("has no samples")
        if wrong := int((~np.isfinite(samples)).sum()):
            raise self.problem(f"has {wrong} samples that are not finite; leave those recordings out")

    def gravity(self, acceleration: npt.NDArray[np.float64], where: str) -> None:
        """Refuse acceleration (…, 3) that cannot be in m/s²."""
        median = float(np.median(np.sqrt((acceleration**2).sum(axis=-1))))
        if not GRAVITY_RANGE[0] <= median <= GRAVITY_RANGE[1]:
            raise self.problem(
                f"{where} acceleration is {median:.3g} long in the median, and gravity alone is 9.81 m/s²:"
                " it seems to be in other units"
            )

    def problem(self, text: str) -> UnusableData:
        return UnusableData(f"{self.path} {text}")
