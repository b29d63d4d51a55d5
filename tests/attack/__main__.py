"""`python -m tests.attack [NAME …] [--quick] [--json]`: run the named attacks, or all, one after another."""

import argparse
import contextlib
import json
import os
import signal
import sys
from dataclasses import asdict

from tests.attack.attack import FULL, QUICK, Result
from tests.attack.table import ATTACKS

NICE = -10  # of the robot and all who are measured, where the system allows it
NAME_WIDTH, CELL_WIDTH = 24, 8


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="./dev attack", description="Attacks on a simulated robot under load."
    )
    parser.add_argument("names", metavar="NAME", nargs="*", help="see --list; without one, all")
    parser.add_argument("--quick", action="store_true", help="a few seconds each, memory after ten seconds")
    parser.add_argument("--json", action="store_true", help="all figures, a line of JSON for each attack")
    parser.add_argument("--list", action="store_true", help="what there is")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in ATTACKS]
    if unknown:
        parser.error(f"there is no attack {', '.join(unknown)}; there are: {', '.join(ATTACKS)}")
    return options


def _write(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _line(name: str, cells: tuple[str, ...], columns: tuple[str, ...]) -> str:
    widths = (max(len(column) + 2, CELL_WIDTH) for column in columns)
    placed = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
    return f"{name:<{NAME_WIDTH}}{''.join(placed)}"


def _show(result: Result, columns: tuple[str, ...]) -> None:
    """A row, under its own head where that is another one than before."""
    if result.columns != columns:
        _write(_line("", result.columns, result.columns))
    verdict = f"NOT KEPT: {', '.join(result.broken)}" if result.broken else "kept"
    _write(f"{_line(result.name, result.cells, result.columns)}  {verdict}")
    for line in (f"told: {result.told}", *result.notes):
        _write(f"{'':<{NAME_WIDTH}}  {line}")


def main() -> int:
    """Exit code: 0, or 1 where a limit was not kept."""
    options = _options()
    signal.signal(signal.SIGTERM, lambda _number, _frame: sys.exit(1))  # what was started ends too
    if options.list:
        for name, attack in ATTACKS.items():
            _write(f"{name:<{NAME_WIDTH}}{attack.about}")
        return 0
    if not options.json:
        load = os.getloadavg()[0] / (os.cpu_count() or 1)
        _write(
            f"Times in ms; load of this machine before: {load:.1f} a core. Columns: tests/attack/README.md"
        )
    with contextlib.suppress(PermissionError):
        os.setpriority(os.PRIO_PROCESS, 0, NICE)
    columns: tuple[str, ...] = ()
    failed = False
    for name in options.names or ATTACKS:
        result = ATTACKS[name].measure(QUICK if options.quick else FULL)
        failed |= bool(result.broken)
        if options.json:
            _write(json.dumps(asdict(result)))
        else:
            _show(result, columns)
        columns = result.columns
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
