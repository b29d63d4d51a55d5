"""A robot's parameters as TOML: a line for each, by its name and in its own unit."""

import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from gateway.coding import Number
from gateway.parameter_files.contents import FileProblem, Saved, Scope, device, is_configuration, is_meant
from gateway.wire.parameter import ParameterInfo

_TABLES = ("robot", "eds", "parameters")


def chosen(scope: Scope, globs: Sequence[str]) -> list[ParameterInfo]:
    """Return the parameters that the globs select; without any, all writable ones."""
    return [
        info
        for info in scope.robot.parameters
        if is_configuration(info)
        and scope.component in (None, info.component)
        and (is_meant(info, globs) if globs else info.read_only is None)
    ]


def write(path: Path, scope: Scope, values: Mapping[str, Number]) -> bytes:
    """Return the file's content."""
    infos = {info.name: info for info in scope.robot.parameters}
    used = {infos[name].component for name in values}
    described = [one for one in scope.robot.components if one.name in used and "eds" in device(one)]
    lines = [
        "# Parameters as the devices of a robot held them, in the units of that robot's file.",
        f"# gwrms params compare {path.name}",
        f"# gwrms params apply {path.name}",
        "",
        "[robot]",
        f"name = {_quoted(scope.robot.robot)}",
        f"saved = {datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}",
        "",
        "[eds]",
        *(f"{_quoted(one.name)} = {_quoted(str(device(one)['eds']))}" for one in described),
        "",
        "[parameters]",
        *(_line(infos[name], value) for name, value in values.items()),
    ]
    return ("\n".join(lines) + "\n").encode()


def read(path: Path, scope: Scope) -> Saved:
    """Read the file's values; raises `FileProblem`."""
    document = _document(path)
    table = document["parameters"]
    values = {name: _value(path, name, value) for name, value in table.items()}
    wanted = {
        name: value for name, value in values.items() if scope.component in (None, name.partition(".")[0])
    }
    return Saved(wanted, tuple(_remarks(document, scope)))


def _line(info: ParameterInfo, value: Number) -> str:
    unit = "".join(sign for sign in info.unit if sign.isprintable())
    return f"{_quoted(info.name)} = {value!r}" + (f"  # {unit}" if unit else "")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def _document(path: Path) -> dict[str, dict[str, object]]:
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FileProblem(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise FileProblem(f"{path}: is no TOML: {error}") from error
    for name, table in document.items():
        if name not in _TABLES or not isinstance(table, dict):
            raise FileProblem(f"{path}: {name!r} has no place in it; there are {_listed(_TABLES)}")
    if not document.get("parameters"):
        raise FileProblem(f'{path}: there is no [parameters] with lines such as "gait.step_length" = 0.42')
    return document


def _listed(tables: tuple[str, ...]) -> str:
    return ", ".join(f"[{name}]" for name in tables)


def _value(path: Path, name: str, value: object) -> Number:
    where = f"{path}: [parameters] {name}"
    if isinstance(value, dict):
        raise FileProblem(f'{where}: a parameter\'s name is one key: write "{name}.{next(iter(value))}" = …')
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise FileProblem(f"{where}: {value!r} is no number")
    return value


def _remarks(document: Mapping[str, Mapping[str, object]], scope: Scope) -> Iterator[str]:
    name = document.get("robot", {}).get("name")
    if name not in (None, scope.robot.robot):
        yield f"it was saved from {name}, this is {scope.robot.robot}"
    files = document.get("eds", {})
    for one in scope.robot.components:
        before, now = files.get(one.name), device(one).get("eds")
        if before not in (None, now):
            yield f"{one.name} was described by {before} then, now by {now}"
