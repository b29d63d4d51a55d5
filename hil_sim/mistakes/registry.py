"""Every mistake by its name."""

from collections.abc import Iterable

from hil_sim.errors import SimulatorError
from hil_sim.mistakes import computer, drives, file, wires
from hil_sim.mistakes.mistake import Mistake

NONE = "none"
MISTAKES: dict[str, Mistake] = {**wires.MISTAKES, **file.MISTAKES, **drives.MISTAKES, **computer.MISTAKES}


def chosen(names: Iterable[str]) -> list[Mistake]:
    """Return the mistakes of these names; raises `SimulatorError`."""
    wanted = [name for name in names if name != NONE]
    for name in wanted:
        if name not in MISTAKES:
            raise SimulatorError(f"there is no mistake {name!r}; there are {', '.join(MISTAKES)}")
    return [MISTAKES[name] for name in wanted]
