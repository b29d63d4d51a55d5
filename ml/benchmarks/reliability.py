"""The reliability diagram of `sim-danger`, and the calibration that ships.

python -m ml.benchmarks.reliability RECORDING PICTURE.svg [CALIBRATION.json]
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import msgspec

from ml.benchmarks.danger import cross_judged, learn, reliability
from ml.benchmarks.danger_data import judgeable, read

SIZE, EDGE = 320, 62  # px, of the diagram and of its margin
LINE, POINT, TEXT = "#8a94a0", "#3a80c4", "#77818d"  # to be read on light and dark
TICKS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)

Table = Sequence[tuple[float, float, int]]


def drawn(table: Table) -> str:
    """Return a picture of what was said, by tenths, against what came true.

    Larger points are more moments.
    """
    most = max(count for *_, count in table)
    way = "L".join(f"{_x(said):.1f} {_y(true):.1f}" for said, true, _ in table)
    shapes = [
        f"<rect x='{EDGE}' y='10' width='{SIZE}' height='{SIZE}' fill='none' stroke='{LINE}'/>",
        f"<path d='M{_x(0)} {_y(0)}L{_x(1)} {_y(1)}' stroke='{LINE}' stroke-dasharray='4 4'/>",
        f"<path d='M{way}' fill='none' stroke='{POINT}'/>",
    ]
    for said, true, count in table:
        radius = 3.0 + 6.0 * (count / most) ** 0.5
        shapes.append(f"<circle cx='{_x(said):.1f}' cy='{_y(true):.1f}' r='{radius:.1f}' fill='{POINT}'/>")
    for tick in TICKS:
        shapes.append(_words(_x(tick), SIZE + 28, f"{tick:g}"))
        shapes.append(_words(EDGE - 20, _y(tick) + 4, f"{tick:g}"))
    shapes.append(_words(EDGE + SIZE / 2, SIZE + 46, "what was said"))
    middle = 10 + SIZE / 2
    turned = f"<g transform='rotate(-90 12 {middle})'>{_words(12, middle, 'share that ended in harm')}</g>"
    width, height = SIZE + EDGE + 14, SIZE + 56
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' "
        f"viewBox='0 0 {width} {height}'>{''.join([*shapes, turned])}</svg>\n"
    )


def _x(share: float) -> float:
    return EDGE + SIZE * share


def _y(share: float) -> float:
    return 10 + SIZE * (1.0 - share)


def _words(x: float, y: float, text: str) -> str:
    style = f"text-anchor='middle' font-family='sans-serif' font-size='12' fill='{TEXT}'"
    return f"<text x='{x:.1f}' y='{y:.1f}' {style}>{text}</text>"


def main(arguments: Sequence[str]) -> int:
    """Draw; where a third file is named, write there what all these wearers teach."""
    recording, picture, *calibration = map(Path, arguments)
    seen, _ = judgeable(recording, read(recording))
    picture.write_text(drawn(reliability(cross_judged(seen))), encoding="utf-8")
    if calibration:
        told = f"{recording.name}: {len({one.subject for one in seen})} simulated wearers"
        calibration[0].write_bytes(
            msgspec.json.format(msgspec.json.encode(learn(seen, told)), indent=1) + b"\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
