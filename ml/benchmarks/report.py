"""A benchmark's outcome as one page of HTML that needs nothing else."""

import html
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from ml.benchmarks.catalogue import Benchmark
from ml.benchmarks.outcome import Outcome

STYLE: Final = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem }
body { color: #1b1f24; background: #fff }
table { border-collapse: collapse; margin: .5rem 0 1.5rem } th, td { padding: .2rem .7rem; text-align: right }
th:first-child, td:first-child { text-align: left } thead th { border-bottom: 2px solid #8a94a0 }
tbody tr:nth-child(even) { background: #f3f5f7 } .reached { color: #17692f } .missed { color: #a4201a }
svg text { font: 12px system-ui, sans-serif; fill: #1b1f24 } p { max-width: 48rem }
"""
CELL, LINE, LABEL, ROW, BAR = 88, 40, 170, 20, 420  # px
BLUE, DARK = "#2a6fb0", "#1b1f24"


def page(benchmark: Benchmark, outcome: Outcome, source: str) -> str:
    """Return the whole document."""
    title = html.escape(f"gwrms evaluate: {benchmark.name}")
    return "\n".join(
        [
            f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{title}</title>",
            f"<style>{STYLE}</style></head><body><h1>{title}</h1>",
            f"<p>{html.escape(benchmark.asks)}. Recordings: {html.escape(source)}.</p>",
            f"<p>A robot's channels for this: {html.escape(', '.join(benchmark.recipe.channels))}.</p>",
            *(f"<p>{html.escape(note)}</p>" for note in outcome.notes),
            "<h2>Figures</h2>",
            _figures(benchmark, outcome),
            *_confusion(outcome),
            *_groups(outcome),
            f"<p>Settings, {html.escape(outcome.settings)}</p></body></html>\n",
        ]
    )


def number(value: float) -> str:
    """Return a figure as people read it."""
    if math.isnan(value):
        return "–"
    return f"{value:.0f}" if abs(value) >= 100 or (value == int(value) and abs(value) > 1) else f"{value:.3g}"


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _figures(benchmark: Benchmark, outcome: Outcome) -> str:
    rows = []
    for name, value in outcome.figures.items():
        goal = benchmark.goals.get(name)
        verdict = "" if goal is None else goal.verdict(value)
        rows.append(
            (
                html.escape(name),
                number(value),
                str(goal or ""),
                f"<span class='{verdict.rpartition(' ')[2]}'>{verdict}</span>",
            )
        )
    return _table(("figure", "value", "goal", ""), rows)


def _confusion(outcome: Outcome) -> list[str]:
    if outcome.confusion is None:
        return []
    counts, names = outcome.confusion, outcome.classes
    shapes = []
    for row, name in enumerate(names):
        shapes.append(_words(LABEL - 8, (row + 1.6) * LINE, name, "end"))
        shapes.append(_words(LABEL + (row + 0.5) * CELL, 0.7 * LINE, name[:12]))
        total = max(int(counts[row].sum()), 1)
        shapes += [_cell(row, column, int(count), count / total) for column, count in enumerate(counts[row])]
    heading = "<h2>Confusion</h2><p>A row is what was, a column what was predicted.</p>"
    return [heading, _svg(LABEL + CELL * len(names), LINE * (len(names) + 1), shapes)]


def _cell(row: int, column: int, count: int, share: float) -> str:
    x, y = LABEL + column * CELL, (row + 1) * LINE
    size = f"width='{CELL - 2}' height='{LINE - 2}'"
    box = f"<rect x='{x}' y='{y}' {size} fill='{BLUE}' fill-opacity='{share:.3f}' stroke='#c5ccd3'/>"
    return box + _words(x + CELL / 2, y + 0.6 * LINE, str(count), "middle", "#fff" if share > 0.5 else DARK)


def _groups(outcome: Outcome) -> list[str]:
    groups = outcome.by_group
    if not groups:
        return []
    columns = list(next(iter(groups.values())))
    rows = [
        (html.escape(name), *(number(values[column]) for column in columns))
        for name, values in groups.items()
    ]
    heading = f"<h2>By {html.escape(outcome.grouped_by)}</h2>"
    return [heading, _bars(columns[0], groups), _table((outcome.grouped_by, *columns), rows)]


def _bars(column: str, groups: Mapping[str, Mapping[str, float]]) -> str:
    highest = max((one[column] for one in groups.values() if not math.isnan(one[column])), default=1.0) or 1.0
    shapes = [_words(LABEL, 14, column, "start")]
    for at, (name, values) in enumerate(groups.items()):
        value = values[column]
        y, width = 22 + at * ROW, 0.0 if math.isnan(value) else BAR * max(value, 0.0) / highest
        shapes.append(_words(LABEL - 8, y + 13, name, "end"))
        shapes.append(f"<rect x='{LABEL}' y='{y}' width='{width:.1f}' height='{ROW - 4}' fill='{BLUE}'/>")
        shapes.append(_words(LABEL + width + 6, y + 13, number(value), "start"))
    return _svg(LABEL + BAR + 60, 30 + ROW * len(groups), shapes)


def _words(x: float, y: float, text: str, anchor: str = "middle", colour: str = DARK) -> str:
    style = f"text-anchor='{anchor}' style='fill:{colour}'"
    return f"<text x='{x:.1f}' y='{y:.1f}' {style}>{html.escape(text)}</text>"


def _svg(width: int, height: int, shapes: Iterable[str]) -> str:
    size = f"width='{width}' height='{height}' viewBox='0 0 {width} {height}'"
    return f"<svg role='img' {size}>{''.join(shapes)}</svg>"
