"""Named layouts of the signals: a TOML file each, to be read, edited and shared."""

import re
import tomllib
from pathlib import Path
from typing import Final

import msgspec
import tomlkit
from msgspec import Struct

from gateway.plain_text import plain
from server_gui.core.atomic_files import draft
from server_gui.core.workspace.grammar import LONGEST, ExpressionError, parse
from server_gui.core.workspace.trigger import Condition, Mode, On
from server_gui.core.workspace.workspace import MOST_CURVES, MOST_PLOTS, PlotSpec

FORMAT: Final = 1
SUFFIX: Final = ".toml"
MOST_BYTES: Final = 65_536
LONGEST_NAME: Final = 60
LONGEST_SPAN_S: Final = 100.0
_CHANNEL: Final = re.compile(r"[^\s=\[\]\"']+")
_HEADER: Final = re.compile(r"\s*\[\[\s*plot\s*\]\]")
_PATH: Final = re.compile(r" - at `\$\.?(.*)`$")


class LayoutError(ValueError):
    """A file that is no layout, or a name that cannot be one; the message names file and place."""


class PlotLayout(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """One plot: its curves as they are written, and what they are drawn over (nothing: time)."""

    curves: list[str]
    x: str = ""


class TriggerLayout(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Condition of a trigger; levels are SI."""

    on: On
    of: str
    level: float = 0.0
    high: float = 0.0
    mode: Mode = Mode.NORMAL
    before: float = 0.5
    hold_off_s: float = 0.0

    @property
    def condition(self) -> Condition:
        """As the trigger takes it."""
        return Condition(self.on, self.of, self.level, self.high, self.mode, self.before, self.hold_off_s)

    @classmethod
    def of_condition(cls, one: Condition) -> "TriggerLayout":
        """As a file has it."""
        return cls(one.on, one.of, one.level, one.high, one.mode, one.before, one.hold_off_s)


class Layout(Struct, forbid_unknown_fields=True, omit_defaults=True):
    """Plots in their order, how much of the past they show, and the trigger."""

    name: str
    plot: list[PlotLayout] = []
    span_s: float = 10.0
    trigger: TriggerLayout | None = None

    @property
    def plots(self) -> list[PlotSpec]:
        """As the workspace takes them."""
        return [PlotSpec(list(plot.curves), plot.x) for plot in self.plot]


class _Format(Struct):
    format: int


def read(path: Path) -> Layout:
    """Return the layout that a file holds.

    Raises:
        LayoutError: it cannot be read, is no layout, or is one of another version.

    """
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise LayoutError(f"{path} cannot be read: {error.strerror or error}") from error
    if len(data) > MOST_BYTES:
        raise LayoutError(f"{path} is no layout: it is larger than {MOST_BYTES // 1024} KiB")
    try:
        return decoded(data.decode("utf-8-sig"))  # as an editor may have saved it
    except UnicodeDecodeError as error:
        raise LayoutError(f"{path} is no text in UTF-8 (byte {error.start})") from error
    except LayoutError as error:
        raise LayoutError(f"{path}: {error}") from error


def decoded(text: str) -> Layout:
    """Return the layout that a file's text tells; raises `LayoutError`, which names line and key."""
    try:
        found = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # a number of 5000 digits is a plain ValueError
        raise LayoutError(f"no TOML: {error}") from error
    if not isinstance(found.get("format"), int):
        raise LayoutError(f"key format: it is to be {FORMAT}, as the first line of a layout")
    number = found.pop("format")
    if number != FORMAT:
        raise LayoutError(
            f"key format: it is {number}, this version reads {FORMAT}: update, or save it again"
        )
    try:
        layout = msgspec.convert(found, Layout)
    except msgspec.ValidationError as error:
        raise LayoutError(_where(str(error), text)) from error
    _check(layout, text)
    return layout


def encoded(layout: Layout) -> str:
    """Return the text of its file."""
    fields = {"format": FORMAT, "name": layout.name, "span_s": layout.span_s}
    builtins = msgspec.to_builtins(layout)
    return tomlkit.dumps(fields | {key: builtins[key] for key in ("trigger", "plot") if key in builtins})


def checked_name(name: str) -> str:
    """Return a layout's name without spaces around it; raises `LayoutError` where it can be none."""
    told = " ".join(name.split())
    if not told or len(told) > LONGEST_NAME or not told.isprintable() or not re.search(r"\w", told):
        raise LayoutError(f"{plain(name)!r} is no name of a layout: it has 1 to {LONGEST_NAME} letters")
    return told


class Layouts:
    """Those in one folder, by their names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def names(self) -> list[str]:
        """Return the names of those that can be read."""
        return sorted(self._found(), key=str.casefold)

    def damaged(self) -> list[str]:
        """Return the problems of unreadable layouts."""
        return [problem for _, problem in map(self._tried, self._files()) if problem]

    def load(self, name: str) -> Layout:
        """Return this one; raises `LayoutError`."""
        return read(self._path(name))

    def save(self, layout: Layout) -> None:
        """Keep it under its name, in place of one that is called so; raises `LayoutError`."""
        layout.name = checked_name(layout.name)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            write(layout, self._found().get(layout.name) or self._free(layout.name))
        except OSError as error:
            raise LayoutError(f"{layout.name} cannot be saved in {self.folder}: {error}") from error

    def rename(self, name: str, to: str) -> None:
        """Call it otherwise; raises `LayoutError`, also where another one is called so."""
        told = checked_name(to)
        if told == name:
            return
        if told in self._found():
            raise LayoutError(f"there is a layout {told} already: delete it first, or take another name")
        layout = self.load(name)
        layout.name = told
        self.save(layout)
        self.delete(name)

    def delete(self, name: str) -> None:
        """Forget it; raises `LayoutError`."""
        try:
            self._path(name).unlink()
        except OSError as error:
            raise LayoutError(f"{name} cannot be deleted: {error.strerror or error}") from error

    def take(self, path: Path) -> Layout:
        """Import a file, under another name where there is one that is called so; raises `LayoutError`."""
        layout, names = read(path), self._found()
        wanted, number = layout.name, 2
        while layout.name in names:
            layout.name, number = f"{wanted[: LONGEST_NAME - 4]} {number}", number + 1
        self.save(layout)
        return layout

    def _files(self) -> list[Path]:
        try:
            return sorted(path for path in self.folder.glob(f"*{SUFFIX}") if not path.is_fifo())
        except OSError:
            return []

    def _found(self) -> dict[str, Path]:
        found: dict[str, Path] = {}
        for path in self._files():
            layout, _ = self._tried(path)
            if layout is not None:
                found.setdefault(layout.name, path)
        return found

    def _tried(self, path: Path) -> tuple[Layout | None, str]:
        try:
            return read(path), ""
        except LayoutError as error:
            return None, str(error)

    def _path(self, name: str) -> Path:
        path = self._found().get(name)
        if path is None:
            raise LayoutError(f"there is no layout {plain(name)} in {self.folder} any more")
        return path

    def _free(self, name: str) -> Path:
        """Return a file for a new one: of its letters, whatever the file system thinks of the others."""
        stem = re.sub(r"\W+", "-", name.casefold(), flags=re.ASCII).strip("-") or "layout"
        place, number = self.folder / f"{stem}{SUFFIX}", 2
        while place.exists():
            place, number = self.folder / f"{stem}-{number}{SUFFIX}", number + 1
        return place


def write(layout: Layout, path: Path) -> None:
    """Write a layout's file, whole or not at all; raises `OSError`."""
    with draft(path) as part:
        part.write_text(encoded(layout), encoding="utf-8")


def _check(layout: Layout, text: str) -> None:
    if checked_name(layout.name) != layout.name:
        raise LayoutError(f"key name: {layout.name!r} has spaces too many")
    if not 0.0 < layout.span_s <= LONGEST_SPAN_S:
        raise LayoutError(f"key span_s: it is above 0 and at most {LONGEST_SPAN_S:g}")
    if len(layout.plot) > MOST_PLOTS:
        raise LayoutError(f"key plot: there are {len(layout.plot)}, at most {MOST_PLOTS} can be")
    if sum(len(plot.curves) for plot in layout.plot) > MOST_CURVES:
        raise LayoutError(f"key plot: more than {MOST_CURVES} curves in all")
    for number, plot in enumerate(layout.plot):
        if not plot.curves:
            raise LayoutError(_at(number, text, "curves", "a plot has one at least"))
        for key, curve in (
            *((f"curves[{place}]", one) for place, one in enumerate(plot.curves)),
            ("x", plot.x),
        ):
            problem = curve_problem(curve) if curve or key != "x" else ""
            if problem:
                raise LayoutError(_at(number, text, key, problem))
    problem = "" if layout.trigger is None else _trigger_problem(layout.trigger)
    if problem:
        raise LayoutError(f"key trigger: {problem}")


def _trigger_problem(trigger: TriggerLayout) -> str:
    if trigger.condition.problem or trigger.on is not On.EMCY:
        return trigger.condition.problem or curve_problem(trigger.of)
    is_component = len(trigger.of) <= LONGEST and trigger.of.isprintable() and _CHANNEL.fullmatch(trigger.of)
    return "" if is_component else f"{plain(trigger.of[:LONGEST_NAME])!r} is no component"


def curve_problem(curve: str) -> str:
    """Return why this can be no curve of any robot; empty if it can."""
    if not curve.isprintable() or len(curve) > LONGEST:
        return f"a curve is written in at most {LONGEST} letters, without breaks"
    try:
        parse(curve)
    except ExpressionError as error:
        plainly_channel = "." in curve and _CHANNEL.fullmatch(curve) and not re.search(r"[-+*/(),]", curve)
        return "" if plainly_channel else f"{curve!r}: {error.line}"
    return ""


def _at(number: int, text: str, key: str, problem: str) -> str:
    """Name the place of a plot: its line in the file, and its key."""
    lines = [line for line, said in enumerate(text.splitlines(), 1) if _HEADER.match(said)]
    where = f"line {lines[number]}, " if number < len(lines) else ""
    return f"{where}key plot[{number}].{key}: {problem}"


def _where(problem: str, text: str) -> str:
    found = _PATH.search(problem)
    if found is None:
        return problem
    key, said = found.group(1), problem[: found.start()]
    plot = re.match(r"plot\[(\d+)\]\.?(.*)", key)
    if plot is not None:
        return _at(int(plot.group(1)), text, plot.group(2), said)
    first = re.split(r"[.\[]", key)[0]
    line = next(
        (n for n, one in enumerate(text.splitlines(), 1) if re.match(rf"\s*\[?{re.escape(first)}\b", one)), 0
    )
    return f"{f'line {line}, ' if line else ''}key {key}: {said}"
