"""The mean stride before and after an edit, with its spread: what a page overlays, kept with the evidence."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
import numpy.typing as npt
from msgspec import Struct

from server_gui.core.evidence.comparison import Evidence, Spell, drawn
from server_gui.core.evidence.cycles import DRAWN, Cycle

MOST = 3  # joints: those that were edited, and those that changed most


class Side(Struct, frozen=True):
    """Over a stride (0–100 %), SI; `mean` and `deviation` are as long."""

    mean: tuple[float, ...]
    deviation: tuple[float, ...]
    cycles: int


class Curves(Struct, frozen=True):
    """One channel's stride before and after an edit; a side without cycles is None."""

    channel: str
    before: Side | None
    after: Side | None


def curves(cycles: Iterable[Cycle], spell: Spell, joints: Iterable[str]) -> tuple[Curves, ...]:
    """Return the strides of these joints on both sides."""
    sides = [(cycle, spell.side(cycle)) for cycle in drawn(cycles, spell)]
    found = []
    for channel in [f"{joint}.{quantity}" for joint in joints for quantity in DRAWN]:
        before, after = (
            [cycle.curves[channel] for cycle, side in sides if side is wanted and channel in cycle.curves]
            for wanted in (False, True)
        )
        if before or after:
            found.append(Curves(channel, _side(before), _side(after)))
    return tuple(found)


def told_joints(evidence: Evidence, edited: Sequence[str]) -> tuple[str, ...]:
    """Return the joints that say most: those that were edited, then those that changed most."""
    strong = sorted(evidence.metrics, key=lambda one: -abs(one.size or 0.0))
    joints = (one.series.rpartition(".")[0] for one in strong)
    return tuple(dict.fromkeys([*edited, *filter(None, joints)]))[:MOST]


def _side(found: Sequence[npt.NDArray[np.float32]]) -> Side | None:
    if not found:
        return None
    stacked = np.stack(found)
    return Side(tuple(_rounded(stacked.mean(axis=0))), tuple(_rounded(stacked.std(axis=0))), len(found))


def _rounded(values: npt.NDArray[np.float32]) -> Iterator[float]:
    return (float(f"{value:.4g}") for value in values)
