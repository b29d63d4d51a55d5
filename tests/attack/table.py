"""Every attack by its name. A new module of attacks is added here."""

from collections.abc import Mapping

from tests.attack import calls, connections, desk, devices, lines, resting, strangers
from tests.attack.attack import Attack

MODULES: tuple[tuple[Attack, ...], ...] = (
    connections.ATTACKS,
    lines.ATTACKS,
    calls.ATTACKS,
    strangers.ATTACKS,
    devices.ATTACKS,
    resting.ATTACKS,
    desk.ATTACKS,
)
ATTACKS: Mapping[str, Attack] = {attack.name: attack for module in MODULES for attack in module}
