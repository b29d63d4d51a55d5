"""A file of parameters beside what a robot holds: what differs, and what cannot be brought about."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gateway.parameter_files.comparison import ComparisonVerdict, Row, compare
from gateway.parameter_files.contents import FileProblem, Saved, Scope, WhichDevice
from gateway.parameter_files.formats import format_of, read_file
from gateway.records import durable
from gateway.wire.parameter import ParameterInfo, ParameterValue
from gateway.wire.robot import Description

Held = Mapping[str, ParameterValue]


@dataclass(slots=True, eq=False)
class Comparison:
    """One file, and how its values stand to the robot's; the rows are those of what can be changed there."""

    path: Path
    saved: Saved
    rows: dict[str, Row] = field(default_factory=dict)
    unchangeable: tuple[str, ...] = ()  # in the file, and not on the robot or not to be changed
    _compared: tuple[object, ...] = ()

    def update(self, known: Mapping[str, ParameterInfo], held: Held) -> None:
        """Compare anew where the robot holds something else than at the last time."""
        if self._compared == (known, held):
            return
        self._compared = known, held
        wanted = {
            name: value for name, value in self.saved.values.items() if name in known and known[name].type
        }
        rows = compare(wanted, known, held)
        self.rows = {row.name: row for row in rows if row.verdict is not ComparisonVerdict.NOT_IN_FILE}
        self.unchangeable = tuple(name for name in self.saved.values if name not in wanted)

    @property
    def different(self) -> list[Row]:
        """Rows with other values on the robot."""
        return [row for row in self.rows.values() if row.verdict is not ComparisonVerdict.SAME]


def open_file(path: Path, description: Description, component: str | None) -> Comparison:
    """Read a file's values for this robot; `component` is a DCF's device, if the file does not name it.

    Raises:
        FileProblem: it cannot be read, or is another device's.

    """
    try:
        return Comparison(path, read_file(path, Scope(description)))
    except WhichDevice as error:
        if component is None:
            said = f"{path} does not say which device it is for"
            raise FileProblem(f"{said}: choose a parameter of that device, then open it again") from error
    return Comparison(path, read_file(path, Scope(description, component)))


def save_file(path: Path, description: Description, held: Held) -> int:
    """Write the robot's writable values as TOML; return their number.

    Raises:
        FileProblem: nothing is held, or the file cannot be written.

    """
    scope, kind = Scope(description), format_of(path)
    values = {
        info.name: held[info.name].value for info in kind.chosen(scope, ()) if held.get(info.name) is not None
    }
    known = {name: value for name, value in values.items() if value is not None}
    if not known:
        raise FileProblem(f"{path}: there is nothing to save, the robot has told no value yet")
    try:
        durable.write(path, kind.write(path, scope, known))
    except OSError as error:
        raise FileProblem(f"{path} cannot be written: {error.strerror or error}") from error
    return len(known)


def staged_as(rows: Iterable[Row]) -> dict[str, float]:
    """Return the edits that apply these rows: each value as the device would hold it."""
    return {row.name: row.file for row in rows if row.file is not None}
