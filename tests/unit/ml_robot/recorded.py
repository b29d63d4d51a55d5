"""Files as `gwrms sim-record` writes them, of made-up people: quick to make, and easy to tell apart."""

import json
from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.robot.groups import GROUPS, unit
from ml.training.simulated import TRUTH

CHANNELS: Final = tuple(channel for group in GROUPS.values() for channel in group)
HZ: Final = 100
ROUND: Final = (
    ("stand", 5.0),
    ("walk", 8.0),
    ("stumble", 1.5),
    ("walk", 4.0),
    ("stand", 4.0),
    ("sit", 5.0),
    ("stand", 4.0),
    ("fall", 1.2),
    ("lying", 3.0),
)

Array = npt.NDArray[np.float64]


def written(path: Path, people: Sequence[int], rounds: int = 2, walks: str = "", lacks: str = "") -> Path:
    """A file of these people's sessions, behind what is there; without joints of the side that it `lacks`."""
    with path.open("a", encoding="utf-8") as file:
        for person in people:
            for line in _without(lacks, lines(person, rounds, walks)):
                file.write(json.dumps(line) + "\n")
    return path


def _without(side: str, lines: list[Any]) -> list[Any]:
    head, *rows = lines
    columns = head["columns"]
    kept = [not (side and name.startswith(side) and name.endswith(".position")) for name in columns]
    return [head | {"columns": list(compress(columns, kept))}, *(list(compress(row, kept)) for row in rows)]


def lines(person: int, rounds: int, walks: str = "") -> list[Any]:
    """The head of a session, and its rows."""
    random = np.random.default_rng(person)
    labels = [label for label, seconds in ROUND * rounds for _ in range(round(seconds * HZ))]
    kind = np.array(labels)
    steps = np.isin(kind, ["walk", "stumble"])
    pace = random.uniform(1.0, 1.4)
    left = np.cumsum(steps) / HZ / pace % 1.0
    values = _values(kind, left, random)
    rows = [
        [10_000_000 * (at + 1), label, *([None, None] if not step else [phase, (phase + 0.5) % 1.0]), *row]
        for at, (label, step, phase, row) in enumerate(
            zip(labels, steps, left.tolist(), values.tolist(), strict=True)
        )
    ]
    columns = [*TRUTH, *CHANNELS]
    units = ["ns", "", "stride", "stride", *(unit(channel) for channel in CHANNELS)]
    head = {"session": f"made-{person}{walks}", "subject": person, "columns": columns, "units": units}
    head |= {"walks": walks} if walks else {}
    return [head, *rows]


def _values(kind: npt.NDArray[np.str_], left: Array, random: np.random.Generator) -> Array:
    """(rows, channels): joints swing, feet take turns, the trunk is light in a fall, jerks in a stumble."""
    walks, sits = np.isin(kind, ["walk", "stumble"]), kind == "sit"
    falls, stumbles, lies = kind == "fall", kind == "stumble", kind == "lying"
    swing = [np.cos(2 * np.pi * (left + shift)) * walks for shift in (0.0, 0.5)]
    share = [np.where(walks, 0.5 - 0.5 * one, 0.5) * np.where(sits | lies, 0.1, 1.0) for one in swing]
    joints = [amount * one + 1.4 * sits + 0.8 * lies for amount in (0.4, 0.6, 0.2) for one in swing]
    forces = [900.0 * one for one in share]
    upwards = 9.81 - 7.0 * falls + 4.0 * walks * np.abs(swing[0])
    trunk = [
        -6.0 * stumbles,
        0 * upwards,
        upwards,
        0 * upwards,
        2.0 * falls + stumbles,
        0.3 * walks * swing[0],
    ]
    tilts = [0.1 + 0.8 * falls + 1.2 * lies + 0.2 * stumbles, 0 * upwards]
    sizes = [0.01] * 6 + [5.0] * 2 + [0.1] * 3 + [0.02] * 3 + [0.01] * 2
    whole = np.stack([*joints, *forces, *trunk, *tilts], axis=1)
    return whole + random.normal(size=whole.shape) * sizes + random.normal(size=len(sizes)) * sizes
