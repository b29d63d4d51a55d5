"""`gwrms evaluate`: how well what we predict holds for people that no model has seen."""

import argparse
import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from gateway.cli.text import say, say_json, table
from ml.benchmarks import BENCHMARKS, Benchmark, Outcome
from ml.benchmarks.report import number, page
from ml.store.private import private_files

EPILOG = f"""benchmarks
{chr(10).join(f"  {one.name:<18} {one.asks}" for one in BENCHMARKS.values())}

The recordings are .npz files; gwrms docs explanation/prediction describes their origin and contents.
Those of sim-… are synthetic, written by gwrms sim-record.
No subject is on both sides, seeds are fixed, and features only look back. Settings are fixed in the code;
--search chooses them again in every fold, by the training subjects alone, which takes many times as long.

examples
  gwrms evaluate --benchmark ipol-status --data gait.npz
  gwrms evaluate --benchmark sisfall-prefall --data falls.npz --json --report falls.html
  gwrms evaluate --benchmark sim-activity --data sim.jsonl.gz

exit status
  0 evaluated, whether or not the goals were reached; 1 the file cannot be used; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms evaluate`."""
    private_files()
    arguments = _parser().parse_args(argv)
    benchmark = BENCHMARKS[arguments.benchmark]
    began = time.monotonic()
    outcome = benchmark.run(arguments.data, arguments.search)
    seconds = time.monotonic() - began
    if arguments.report is not None:
        arguments.report.write_text(page(benchmark, outcome, arguments.data.name), encoding="utf-8")
    say(_text(benchmark, outcome, seconds))
    if arguments.json:
        say_json(_answer(benchmark, outcome, seconds))
    return 0


def _text(benchmark: Benchmark, outcome: Outcome, seconds: float) -> str:
    people = "" if outcome.subjects is None else f", {outcome.subjects} subjects"
    rows = []
    for name, value in outcome.figures.items():
        goal = benchmark.goals.get(name)
        verdict = "" if goal is None else goal.verdict(value)
        rows.append((name, number(value), str(goal or ""), verdict))
    columns = list(next(iter(outcome.by_group.values()), ()))
    groups = [
        (name, *(number(values[column]) for column in columns)) for name, values in outcome.by_group.items()
    ]
    return "\n".join(
        [
            f"{benchmark.name}: {benchmark.asks}{people}, {seconds:.0f} s",
            f"channels: {', '.join(benchmark.recipe.channels)}",
            *outcome.notes,
            "",
            table(("FIGURE", "VALUE", "GOAL", ""), rows, (1,)),
            table((outcome.grouped_by.upper(), *columns), groups, range(1, len(columns) + 1)),
            f"settings, {outcome.settings}\n",
        ]
    )


def _answer(benchmark: Benchmark, outcome: Outcome, seconds: float) -> dict[str, Any]:
    groups = {name: _finite(figures) for name, figures in outcome.by_group.items()}
    by = f"by_{outcome.grouped_by.replace(' ', '_')}"
    about = {"subjects": outcome.subjects, "seconds": round(seconds, 1), by: groups}
    return {"benchmark": benchmark.name, **_finite(outcome.figures), **about}


def _finite(figures: Mapping[str, float]) -> dict[str, float | None]:
    return {name: None if math.isnan(value) else value for name, value in figures.items()}


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms evaluate",
        description="Evaluate predictions on people, real or simulated, whom no model has seen.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--benchmark",
        required=True,
        choices=BENCHMARKS,
        metavar="NAME",
        help="a benchmark from the list below",
    )
    parser.add_argument("--data", required=True, type=Path, metavar="FILE", help="the recordings")
    parser.add_argument(
        "--json",
        action="store_true",
        help="print the figures, including groups, as a JSON object in the last line",
    )
    parser.add_argument(
        "--report", type=Path, metavar="FILE.html", help="also write a page with tables and pictures"
    )
    parser.add_argument(
        "--search", action="store_true", help="tune the settings again, on training subjects only"
    )
    return parser
