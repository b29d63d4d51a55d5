"""`gwrms check`: what is wrong with files, and with what a robot's file needs, without starting anything."""

import argparse
import importlib
import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from gateway.amounts import counted
from gateway.cli.text import say, say_json
from gateway.tables.finding import Finding, Severity
from gateway.tables.line_numbers import Places
from gateway.tables.reading import Unreadable, as_far_as_readable, parse, read

_DESCRIPTION = """\
Check a robot's file, a server's file or a scenario as a gateway, a collector or `gwrms sim run` would read
it, and report all mistakes at once: line, table, key, what is allowed and what was probably meant. The kind
of a file is recognised by its tables. Nothing is started, and nothing is written.

For a robot's file, its surroundings are checked too: whether EDS files, layouts and calibrations are usable
and allow its parameters, whether the ports exist and this user may open them, whether the CAN links are up
and run at its bit rate, and whether its address is this computer's.
"""
_EPILOG = """\
For a mistake the file is refused; for one in a file that it names, the gateway starts without the component
that needs that file. A warning is about something that can work but was probably not meant, or that this
computer lacks so far. A gateway reports the same about its file and devices' files when it starts, and about
ports and buses in gwrms describe. Lines that are not TOML are reported, and the rest is checked without them;
text after an unreadable header, or in a value without an end, cannot be checked.

exit status: 0 no mistakes; 1 mistakes, with --strict also warnings; 2 usage

examples
  gwrms check robot.toml
  gwrms check --no-machine --json *.toml
  gwrms check --schema robot > robot.schema.json
"""

_MISSING: Final = "is missing"  # which is not known where a line could not be read


@dataclass(frozen=True, slots=True)
class FileKind:
    """One kind of file: where it is checked and described, and the tables or keys that only it has."""

    what: str
    check: str  # of file, its tables, and whether to look at this computer
    schema: str
    marks: frozenset[str]


# What is not installed is needed by its own kind only.
KINDS: Final[Mapping[str, FileKind]] = {
    "robot": FileKind(
        "a robot's file",
        "gateway.cli.check_robot:findings",
        "gateway.config.schema:schema",
        frozenset(
            [
                "gateway",
                "can",
                "joint",
                "device",
                "insole",
                "imu",
                "parameter",
                "stop",
                "guard",
                "control_loop",
                "robot.name",
            ]
        ),
    ),
    "server": FileKind(
        "a server's file",
        "server_gui.core.settings.server_file:findings",
        "server_gui.core.settings.schema:schema",
        frozenset(["robots", "store", "recorder", "prediction", "rules"]),
    ),
    "scenario": FileKind(
        "a scenario",
        "gateway.cli.check_scenario:findings",
        "gateway.cli.check_scenario:schema",
        frozenset(
            ["at", "expect", "guard", "title", "robot.scenario", "robot.seconds", "robot.imu", "robot.insole"]
        ),
    ),
}


@dataclass(frozen=True, slots=True)
class Checked:
    """One file's result; `kind` is None where it could not be read."""

    file: Path
    kind: str | None
    findings: list[Finding]

    def count(self, severity: Severity) -> int:
        return sum(one.severity is severity for one in self.findings)


def main(argv: list[str]) -> int:
    """Run `gwrms check`."""
    parser = _parser()
    arguments = parser.parse_args(argv)
    if arguments.schema is not None:
        say(json.dumps(_find(KINDS[arguments.schema].schema)(), indent=2, ensure_ascii=False) + "\n")
        return 0
    if not arguments.files:
        parser.error("name a file, or use --schema")
    results = [check(file, arguments.kind, machine=arguments.machine) for file in arguments.files]
    for one in results:
        say_json(_as_json(one)) if arguments.json else say(_as_text(one))
    refused = {Severity.MISTAKE, Severity.WARNING} if arguments.strict else {Severity.MISTAKE}
    return int(any(finding.severity in refused for one in results for finding in one.findings))


def check(file: Path, kind: str | None = None, *, machine: bool = True) -> Checked:
    """Everything that is wrong with a file, or likely is; its kind is what its tables show, unless given."""
    try:
        tables = read(file)
        text = file.read_text(encoding="utf-8")
    except Unreadable as error:
        found, rest = as_far_as_readable(file, error.finding)
        more = (
            [] if rest is None else _check(file, kind, rest, parse(rest.encode()), machine=machine).findings
        )
        return Checked(file, kind, [*found, *(one for one in more if not one.text.startswith(_MISSING))])
    return _check(file, kind, text, tables, machine=machine)


def _check(file: Path, kind: str | None, text: str, tables: Mapping[str, Any], *, machine: bool) -> Checked:
    what, places = kind or recognised(file, tables), Places(text)
    told = _find(KINDS[what].check)(file, tables, machine=machine)
    findings = [Finding(where, key, said, Severity(how)) for how, where, key, said in told]
    return Checked(file, what, [replace(one, line=places.line(one)) for one in findings])


def recognised(file: Path, tables: Mapping[str, Any]) -> str:
    """Return the kind of file: the one with most of its tables, else by its name."""
    robot = tables.get("robot")
    keys = {*tables, *(f"robot.{key}" for key in (robot if isinstance(robot, dict) else ()))}

    def likely(kind: str) -> tuple[int, bool]:
        return len(KINDS[kind].marks & keys), kind in file.stem

    return max(KINDS, key=likely)


def _find(path: str) -> Callable[..., Any]:
    module, _, name = path.partition(":")
    found: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return found


def _as_json(one: Checked) -> dict[str, object]:
    return {
        "file": str(one.file),
        "kind": one.kind,
        "ok": not one.count(Severity.MISTAKE),
        "findings": [
            {
                "severity": found.severity.value,
                "where": found.where,
                "key": found.key,
                "text": found.text,
                "line": found.line,
            }
            for found in one.findings
        ],
    }


def _as_text(one: Checked) -> str:
    lines = [
        f"{_place(one.file, found)}: {found.severity}: {found.words}" for found in _worst_first(one.findings)
    ]
    return "\n".join([*lines, f"{one.file}: {_summary(one)}\n"])


def _place(file: Path, found: Finding) -> str:
    return str(file) if found.line is None else f"{file}:{found.line}"


def _summary(one: Checked) -> str:
    what = KINDS[one.kind].what if one.kind is not None else "not read"
    said = [counted(number, severity.value) for severity in Severity if (number := one.count(severity))] or [
        "nothing is wrong"
    ]
    return f"{what}, {', '.join(said)}"


def _worst_first(findings: Iterable[Finding]) -> Sequence[Finding]:
    return sorted(findings, key=lambda found: list(Severity).index(found.severity))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms check",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("files", nargs="*", type=Path, metavar="FILE", help="a file to check")
    parser.add_argument(
        "--kind", choices=tuple(KINDS), help="the kind of the files (default: by their tables)"
    )
    parser.add_argument(
        "--no-machine",
        dest="machine",
        action="store_false",
        help="check only the files and those beside them, not this computer's address, ports and CAN links",
    )
    parser.add_argument("--strict", action="store_true", help="exit with status 1 for warnings too")
    parser.add_argument("--json", action="store_true", help="print one JSON object per file, a line each")
    parser.add_argument(
        "--schema", choices=tuple(KINDS), help="print the JSON Schema of such files, for editors"
    )
    return parser
