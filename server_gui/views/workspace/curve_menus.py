"""Menus by which curves come into plots, and out of them: all that a drag can do, by keys too."""

from collections.abc import Callable

from PySide6.QtWidgets import QMenu

from gateway.plain_text import plain
from server_gui.core.workspace.scene import Scene
from server_gui.core.workspace.workspace import said

Do = Callable[[Callable[[], object]], None]  # does it, and says why not


def channel_menu(menu: QMenu, scene: Scene, text: str, do: Do) -> None:
    """Fill the menu of a channel of the tree."""
    meant, workspace = scene.meaning(text), scene.workspace
    for place, unit in enumerate(scene.units()):
        action = menu.addAction(f"Add to plot {place + 1} ({said(unit)})")
        action.setEnabled(text not in workspace.plots[place].curves)
        action.triggered.connect(
            lambda _=False, place=place, unit=unit: do(lambda: workspace.add(meant, place, unit))
        )
    menu.addAction("New plot").triggered.connect(lambda: do(lambda: workspace.new_plot(meant)))
    over = menu.addMenu("XY plot of it over")
    for other in workspace.curves:
        action = over.addAction(shown(scene.meaning(other).name))
        action.triggered.connect(lambda _=False, other=other: do(lambda: workspace.new_plot(meant, other)))
    over.setEnabled(bool(workspace.curves))
    action = menu.addAction("Remove from every plot")
    action.setEnabled(text in workspace.curves)
    action.triggered.connect(lambda: do(lambda: workspace.remove(text)))


def plot_menu(menu: QMenu, scene: Scene, place: int, do: Do) -> None:
    """Fill the menu of a plot and its curves."""
    menu.clear()
    workspace = scene.workspace
    plot = workspace.plots[place]
    for text in plot.curves:
        of_it = menu.addMenu(shown(scene.meaning(text).name))
        of_it.addAction("Remove").triggered.connect(
            lambda _=False, text=text: do(lambda: workspace.remove(text, place))
        )
        meant = scene.meaning(text)
        of_it.addAction("Also in a new plot").triggered.connect(
            lambda _=False, meant=meant: do(lambda: workspace.new_plot(meant))
        )
    menu.addSeparator()
    over = menu.addMenu("Draw over")
    time = over.addAction("time")
    time.setEnabled(plot.is_xy)
    time.triggered.connect(lambda: do(lambda: workspace.turn(place, "")))
    for text in workspace.curves:
        action = over.addAction(shown(scene.meaning(text).name))
        action.setEnabled(text != plot.x)
        action.triggered.connect(lambda _=False, text=text: do(lambda: workspace.turn(place, text)))
    menu.addAction("Remove this plot").triggered.connect(lambda: do(lambda: workspace.remove_plot(place)))


def shown(name: str) -> str:
    """Return a name as a menu shows it."""
    return plain(name).replace("&", "&&")
