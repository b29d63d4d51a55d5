"""What an attack is: a name, what it does, and how it is measured; and what came of it.

A module of attacks has a table `ATTACKS`. Most are `Strike`s, a function that a process of its own calls
while the robot is measured (`robot_attack.py`); one that needs another victim has a `measure` of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from tests.attack.barrage import Said, Target


@dataclass(frozen=True)
class Lengths:
    """Seconds without the attack, with it, and after it."""

    quiet_s: float
    attack_s: float
    after_s: float


FULL = Lengths(20.0, 30.0, 60.0)
QUICK = Lengths(5.0, 6.0, 10.0)


@dataclass(frozen=True)
class Result:
    """One row: `cells` stand under `columns`; `broken` are the limits that were not kept, in words."""

    name: str
    columns: tuple[str, ...]
    cells: tuple[str, ...]
    broken: tuple[str, ...]
    told: str  # to the attacker
    notes: tuple[str, ...] = ()  # what the columns do not say
    figures: Mapping[str, Any] = field(default_factory=dict)  # for machines


class Attack(Protocol):
    """One row of the table."""

    @property
    def name(self) -> str: ...

    @property
    def about(self) -> str: ...

    def measure(self, lengths: Lengths) -> Result: ...


@dataclass(frozen=True)
class Strike:
    """An attack by clients on the robot under load; `run` is called in the attacker's process.

    With `changes_nothing` the attacker may neither write a parameter nor be answered, and it tries also
    before the first stop, when a write would be allowed.
    """

    name: str
    about: str
    run: Callable[[Target], Said]
    changes_nothing: bool = False

    def measure(self, lengths: Lengths) -> Result:
        from tests.attack.robot_attack import measure  # it needs what an attacker does not

        return measure(self, lengths)


@dataclass(frozen=True)
class DeviceAttack:
    """An attack by something on the robot's own wires: on its bus, or on a serial port.

    `nodes` are the drives that are not to blame. `sensor` is the one whose port is attacked, if any.
    """

    name: str
    about: str
    nodes: tuple[int, ...]
    imu: str = "witmotion"
    insole: str = "insole-cobs"
    sensor: str | None = None

    def measure(self, lengths: Lengths) -> Result:
        from tests.attack.robot_attack import measure_device

        return measure_device(self, lengths)
