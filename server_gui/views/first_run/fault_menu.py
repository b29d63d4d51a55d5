"""Menu of the simulated robot's faults, by their targets, each with its symptoms."""

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from PySide6.QtWidgets import QMenu

from server_gui.processes.sim_control import FaultKind, Listed
from server_gui.views.widgets.plain import set_tip

# A device that is among those of a group, and the group's name; the first that fits.
GROUPS: Final = (
    ("gait", "Node on the bus"),
    ("left_knee", "Drive of a joint"),
    ("bus", "The bus itself"),
    ("trunk", "IMU or a sensor"),
    ("left_insole", "Insole"),
    ("insoles", "Insole"),
    ("wearer", "Wearer"),
    ("host", "Robot's computer"),
)
OTHERS: Final = "Others"
ABBREVIATED: Final = {"sto": "safe torque off (STO)"}


def words(name: str) -> str:
    """Return a name of the simulator as people read it."""
    return ABBREVIATED.get(name) or name.replace("_", " ")


def grouped(faults: Mapping[str, FaultKind]) -> dict[str, dict[str, FaultKind]]:
    """Return faults by their group, in the order of the menu."""
    found: dict[str, dict[str, FaultKind]] = {title: {} for _, title in GROUPS}
    for name, kind in faults.items():
        title = next((title for device, title in GROUPS if device in kind.on), OTHERS)
        found.setdefault(title, {})[name] = kind
    return {title: kinds for title, kinds in found.items() if kinds}


def fill(menu: QMenu, listed: Listed, chosen: Callable[[str, str], None]) -> None:
    """Make the menu anew; `chosen` is told a fault and its device."""
    menu.clear()
    for title, kinds in grouped(listed.faults).items():
        group = menu.addMenu(title)
        group.setToolTipsVisible(True)
        for name, kind in kinds.items():
            for target, device, text in _entries(group, name, kind):
                action = target.addAction(text)
                set_tip(action, kind.looks)
                action.setCheckable(device in kind.active)
                action.setChecked(device in kind.active)
                action.setEnabled(device not in kind.active)
                action.triggered.connect(lambda _=False, name=name, device=device: chosen(name, device))


def _entries(group: QMenu, name: str, kind: FaultKind) -> Iterator[tuple[QMenu, str, str]]:
    """Yield each entry's menu, device and words: a menu of devices if there are several."""
    if len(kind.on) == 1:
        yield group, kind.on[0], words(name)
        return
    devices = group.addMenu(words(name))
    devices.setToolTipsVisible(True)
    set_tip(devices.menuAction(), kind.looks)
    for device in kind.on:
        yield devices, device, words(device)
