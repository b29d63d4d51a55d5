"""Expressions, units checked, computed for new rows only; what a missing sample is part of is missing."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from server_gui.core.workspace.dimensions import Dimension, literal
from server_gui.core.workspace.grammar import ExpressionError, ExpressionNode, Written

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int64]

LONGEST_S: Final = 60.0  # that `rms` and `mean` may go over
EXACT: Final = 1e-9  # of a sum: what rounding may take of it
NONE: Final = Dimension()
ANGLE: Final = Dimension.of("rad")
HERTZ, SECOND = Dimension.of("Hz"), Dimension.of("s")
WORDS: Final = {"+": "added", "-": "subtracted"}


@dataclass(frozen=True, slots=True)
class Block:
    """Rows that follow those of the block before: their times (s, rising), and a column a channel."""

    times: Floats
    columns: Mapping[str, Floats]


Step = Callable[[Block], Floats]  # the value of each row, or one for all


@dataclass(frozen=True, slots=True)
class Subexpression:
    """A part of an expression that can be computed, and its unit."""

    step: Step
    dimension: Dimension


class Program:
    """An expression over one run of rows: `take` brings block after block, and remembers what it needs."""

    def __init__(self, written: Written, text: str, units: Mapping[str, str]) -> None:
        """`units` has the SI unit of every channel of `written`.

        Raises:
            ExpressionError: its units do not fit, or a function is not used as it can be.

        """
        self.channels = tuple(sorted(written.channels))
        part = _Compiler(text, units).part(written.tree)
        self.unit = part.dimension.symbol
        self._step = part.step

    def take(self, block: Block) -> Floats:
        """Return a value for each of these rows; NaN where there is none."""
        with np.errstate(all="ignore"):
            found = np.array(np.broadcast_to(self._step(block), len(block.times)), np.float64)
        found[~np.isfinite(found)] = np.nan
        return found


class _Compiler:
    def __init__(self, text: str, units: Mapping[str, str]) -> None:
        self._text = text
        self._units = units

    def part(self, node: ExpressionNode) -> Subexpression:
        match node.kind:
            case "number":
                return self._number(node)
            case "channel":
                return _channel(node.text, self._units[node.text])
            case "negative":
                inner = self.part(node.parts[0])
                return Subexpression(lambda block: -inner.step(block), inner.dimension)
            case "call":
                return self._call(node)
        return self._sign(node, *(self.part(each) for each in node.parts))

    def _number(self, node: ExpressionNode) -> Subexpression:
        factor, dimension = 1.0, NONE
        if node.unit is not None:
            found = literal(node.unit)
            if found is None:
                raise self._error(
                    f"nobody here knows the unit {node.unit!r}: write such as [rad], [°], [N·m]", node
                )
            factor, dimension = found
        value = np.float64(float(node.text) * factor)
        return Subexpression(lambda _block: np.asarray(value), dimension)

    def _sign(self, node: ExpressionNode, left: Subexpression, right: Subexpression) -> Subexpression:
        one, other = left.step, right.step
        if node.kind in WORDS:
            self._same(node, WORDS[node.kind], left, right)
            if node.kind == "+":
                return Subexpression(lambda block: one(block) + other(block), left.dimension)
            return Subexpression(lambda block: one(block) - other(block), left.dimension)
        if node.kind == "*":
            return Subexpression(
                lambda block: one(block) * other(block), left.dimension.times(right.dimension)
            )
        return Subexpression(
            lambda block: one(block) / other(block), left.dimension.times(right.dimension, -1)
        )

    def _call(self, node: ExpressionNode) -> Subexpression:
        if node.text not in FUNCTIONS:
            raise self._error(
                f"there is no function {node.text}: there are {', '.join(sorted(FUNCTIONS))}", node
            )
        least, most, make = FUNCTIONS[node.text]
        if not least <= len(node.parts) <= most:
            many = f"{least} argument{'s' * (least > 1)}" if least == most else f"{least} arguments or more"
            raise self._error(f"{node.text} takes {many}, not {len(node.parts)}", node)
        return make(self, node, [self.part(each) for each in node.parts])

    def _same(self, node: ExpressionNode, done: str, *parts: Subexpression) -> None:
        for other in parts[1:]:
            if other.dimension != parts[0].dimension:
                both = f"{parts[0].dimension.said} and {other.dimension.said}"
                hint = (
                    ": give the number a unit, as 5 [°]"
                    if NONE in (parts[0].dimension, other.dimension)
                    else ""
                )
                raise self._error(f"{both} cannot be {done}{hint}", node)

    def _is(self, node: ExpressionNode, part: Subexpression, wanted: Dimension) -> None:
        if part.dimension != wanted:
            raise self._error(f"{node.text} is of {wanted.said}, not of {part.dimension.said}", node)

    def _constant(self, node: ExpressionNode, wanted: Dimension, most: float) -> float:
        """Return the second argument: a number above 0 and up to `most`, in this unit or none."""
        told = node.parts[1]
        if told.kind != "number":
            raise self._error(f"the second argument of {node.text} is a number in {wanted.said}", told)
        part = self._number(told)
        value = float(part.step(Block(np.zeros(0), {})))
        if part.dimension not in (wanted, NONE):
            raise self._error(f"it is in {wanted.said}, not in {part.dimension.said}", told)
        if not 0.0 < value <= most:
            raise self._error(f"it is above 0 and at most {most:g} {wanted.said}", told)
        return value

    def _error(self, problem: str, node: ExpressionNode) -> ExpressionError:
        return ExpressionError(problem, self._text, node.place, node.length)

    # --- functions

    def plain(self, _node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`abs`."""
        return Subexpression(lambda block: np.abs(parts[0].step(block)), parts[0].dimension)

    def least(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`min` of what is at one time."""
        return self._extreme(node, parts, np.minimum)

    def most(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`max` of what is at one time."""
        return self._extreme(node, parts, np.maximum)

    def _extreme(
        self, node: ExpressionNode, parts: Sequence[Subexpression], better: Callable[[Floats, Floats], Floats]
    ) -> Subexpression:
        self._same(node, "compared", *parts)

        def step(block: Block) -> Floats:
            found = parts[0].step(block)
            for part in parts[1:]:
                found = better(found, part.step(block))
            return found

        return Subexpression(step, parts[0].dimension)

    def root(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`sqrt`."""
        dimension = parts[0].dimension.root()
        if dimension is None:
            raise self._error(f"{parts[0].dimension.said} has no square root", node)
        return Subexpression(lambda block: np.sqrt(parts[0].step(block)), dimension)

    def angle(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`sin`, `cos`."""
        self._is(node, parts[0], ANGLE)
        wave = np.sin if node.text == "sin" else np.cos
        return Subexpression(lambda block: wave(parts[0].step(block)), NONE)

    def degrees(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`deg`: an angle as a plain number of degrees."""
        self._is(node, parts[0], ANGLE)
        return Subexpression(lambda block: np.degrees(parts[0].step(block)), NONE)

    def slope(self, _node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`diff`: by time, from row to row."""
        return Subexpression(_Slope(parts[0].step), parts[0].dimension.times(SECOND, -1))

    def smooth(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`lowpass`: of first order."""
        return Subexpression(_LowPass(parts[0].step, self._constant(node, HERTZ, 1e4)), parts[0].dimension)

    def over(self, node: ExpressionNode, parts: Sequence[Subexpression]) -> Subexpression:
        """`rms`, `mean`: over the last seconds."""
        seconds = self._constant(node, SECOND, LONGEST_S)
        return Subexpression(_Window(parts[0].step, seconds, squared=node.text == "rms"), parts[0].dimension)


def _channel(name: str, unit: str) -> Subexpression:
    return Subexpression(lambda block: block.columns[name], Dimension.of(unit))


def _column(step: Step, block: Block) -> Floats:
    return np.asarray(np.broadcast_to(step(block), len(block.times)), np.float64)


class _Slope:
    def __init__(self, step: Step) -> None:
        self._step = step
        self._last = (math.nan, math.nan)  # time, value

    def __call__(self, block: Block) -> Floats:
        values = _column(self._step, block)
        if not len(values):
            return values
        time_s, value = self._last
        self._last = float(block.times[-1]), float(values[-1])
        return np.diff(values, prepend=value) / np.diff(block.times, prepend=time_s)


class _LowPass:
    """Begins anew after whatever is missing, with what comes then."""

    def __init__(self, step: Step, cutoff_hz: float) -> None:
        self._step = step
        self._cutoff = 2 * math.pi * cutoff_hz
        self._time_s = self._value = math.nan

    def __call__(self, block: Block) -> Floats:
        values = _column(self._step, block)
        if not len(values):
            return values
        shares = 1.0 - np.exp(-self._cutoff * np.diff(block.times, prepend=self._time_s))
        value, found = self._value, []
        for new, share in zip(values.tolist(), shares.tolist(), strict=True):
            value = new if value != value or new != new else value + share * (new - value)
            found.append(value)
        self._time_s, self._value = float(block.times[-1]), value
        return np.array(found)


class _Window:
    """Missing until the window is full, and where anything in it is missing.

    Sums go on from block to block, so that a row costs the same whatever the window; they begin anew now and
    then, with what is still needed.
    """

    def __init__(self, step: Step, seconds: float, *, squared: bool) -> None:
        self._step = step
        self._seconds = seconds
        self._squared = squared
        self._first = self._end = 0  # rows that are needed still, of those kept
        self._times: Floats = np.zeros(0)
        self._known: Floats = np.zeros(0)  # 0 where missing
        self._sums: Floats = np.zeros((3, 1))  # of all rows before each: what is known, gaps, the largest sum

    def __call__(self, block: Block) -> Floats:
        new = _column(self._step, block)
        if not len(new):
            return new
        self._add(block.times, new * new if self._squared else new)
        ends = np.arange(self._end - len(new), self._end)
        due = block.times - self._seconds + 1e-9
        begins = self._first + np.searchsorted(self._times[self._first : self._end], due, "left")
        gaps = self._sums[1]
        whole = (begins > 0) & (gaps[ends + 1] == gaps[np.maximum(begins - 1, 0)])
        found = self._differences(begins, ends + 1) / (ends + 1 - begins)
        self._first = max(int(begins[-1]) - 1, 0)
        if self._squared:
            found = np.sqrt(np.maximum(found, 0.0))
        return np.where(whole, found, np.nan)

    def _add(self, times: Floats, column: Floats) -> None:
        missing = ~np.isfinite(column)
        known = np.where(missing, 0.0, column)
        if self._end + len(times) > len(self._times):
            old, self._end = slice(self._first, self._end), self._end - self._first
            kept, self._first = (self._times[old], self._known[old], np.diff(self._sums[1])[old]), 0
            times, known = np.concatenate((kept[0], times)), np.concatenate((kept[1], known))
            missing, self._end = np.concatenate((kept[2], missing)), 0
            self._times, self._known = np.zeros(2 * len(times)), np.zeros(2 * len(times))
            self._sums = np.zeros((3, 2 * len(times) + 1))
        place, end = slice(self._end, self._end + len(times)), self._end + len(times)
        after = slice(self._end + 1, end + 1)
        self._times[place], self._known[place] = times, known
        before = self._sums[:, self._end]
        self._sums[0, after] = before[0] + np.cumsum(known)
        self._sums[1, after] = before[1] + np.cumsum(missing)
        self._sums[2, after] = np.maximum(before[2], np.maximum.accumulate(np.abs(self._sums[0, after])))
        self._end = end

    def _differences(self, begins: Rows, ends: Rows) -> Floats:
        """Return the sum from each begin to its end; by hand where it drowns in what came before."""
        found: Floats = self._sums[0, ends] - self._sums[0, begins]
        error = np.finfo(np.float64).eps * self._sums[2, ends]
        drowned = np.flatnonzero(~(error <= EXACT * np.abs(found)) | np.isinf(error))
        if len(drowned):
            first = int(begins[drowned[0]])
            pairs = np.column_stack((begins[drowned], ends[drowned])).ravel() - first
            found[drowned] = np.add.reduceat(np.append(self._known[first : self._end], 0.0), pairs)[::2]
        return found


Make = Callable[[_Compiler, ExpressionNode, Sequence[Subexpression]], Subexpression]
FUNCTIONS: Final[Mapping[str, tuple[int, int, Make]]] = {
    "abs": (1, 1, _Compiler.plain),
    "min": (2, 99, _Compiler.least),
    "max": (2, 99, _Compiler.most),
    "sqrt": (1, 1, _Compiler.root),
    "sin": (1, 1, _Compiler.angle),
    "cos": (1, 1, _Compiler.angle),
    "deg": (1, 1, _Compiler.degrees),
    "diff": (1, 1, _Compiler.slope),
    "lowpass": (2, 2, _Compiler.smooth),
    "rms": (2, 2, _Compiler.over),
    "mean": (2, 2, _Compiler.over),
}
