"""Export of the visible signals as CSV: SI units, every digit, a row for each time."""

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from server_gui.core.workspace.scene import Scene


def save_csv(
    scene: Scene, texts: Sequence[str], seconds: float, window: tuple[float, float], path: Path
) -> None:
    """Save these curves between two times, s until the newest row of those `seconds`; raises `OSError`."""
    found = scene.times(seconds)
    times = found - found[-1] if len(found) else found
    sight = slice(int(np.searchsorted(times, window[0])), int(np.searchsorted(times, window[1], "right")))
    columns = {text: scene.values(text, len(times))[sight] for text in texts}
    titles = [f"{scene.meaning(text).name} {_si(scene, text)}".rstrip() for text in texts]
    if scene.beside is not None:
        who = scene.beside.station.title
        columns |= {f"{who}: {text}": scene.values_beside(text, found)[sight] for text in texts}
        titles += [f"{who}: {title}" for title in titles]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time s", *titles])
        for row, time_s in enumerate(times[sight]):
            values = (column[row] for column in columns.values())
            writer.writerow([f"{time_s:.6f}", *("" if np.isnan(value) else value for value in values)])


def _si(scene: Scene, text: str) -> str:
    unit = scene.meaning(text).unit
    return "" if unit is None else unit.si
