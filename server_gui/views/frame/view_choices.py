"""What people choose of how all is shown: colours, size of text, units."""

from collections.abc import Callable
from typing import Final

from PySide6.QtWidgets import QMenu

from gateway.units import UNITS, Units
from server_gui.core.desk.desk import Desk
from server_gui.views.theme import Look, Theme
from server_gui.views.widgets.choice_menu import choices

SCALES: Final = (80, 90, 100, 125, 150, 175, 200)
# Quantities with more than one unit worth choosing.
CHOICES: Final = ("rad", "rad/s", "m", "Pa", "m/s²", "s", "A")


def add_choices(menu: QMenu, desk: Desk, theme: Theme) -> None:
    """Add a menu for each."""
    looks = {look.value.capitalize(): look for look in Look}
    now = theme.look.value.capitalize()
    choices(menu.addMenu("Colours"), list(looks), now, lambda text: theme.set(look=looks[text]))
    sizes = {f"{percent} %": percent / 100 for percent in SCALES}
    size = f"{round(theme.scale * 100)} %"
    choices(menu.addMenu("Text size"), list(sizes), size, lambda text: theme.set(scale=sizes[text]))
    units = menu.addMenu("Units")
    for si in CHOICES:
        symbols = [unit.symbol for unit in UNITS[si]]
        chosen = desk.shown.units.unit("", si).symbol
        choices(units.addMenu(f"{si} as"), symbols, chosen, _unit_setter(desk, si))


def _unit_setter(desk: Desk, si: str) -> Callable[[str], None]:
    def choose(symbol: str) -> None:
        by_si = dict(desk.shown.units.by_si) | {si: symbol}
        desk.shown.change(Units(by_si=by_si))

    return choose
