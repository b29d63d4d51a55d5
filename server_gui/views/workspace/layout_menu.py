"""The menu of named layouts: opened, saved, renamed, deleted, brought in and given away as files."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from PySide6.QtWidgets import QLineEdit, QMenu, QPushButton

from gateway.plain_text import plain
from server_gui.core.workspace.layouts import Layout, LayoutError, Layouts, read, write
from server_gui.views.confirmation import ask
from server_gui.views.widgets.files import ask_open, ask_save
from server_gui.views.widgets.plain import set_tip

UNNAMED: Final = "signals"


class LayoutMenu(QPushButton):
    """`present` gives what is shown as a layout, `show_layout` shows one, `say` tells what came of it."""

    def __init__(
        self,
        layouts: Layouts,
        present: Callable[[], Layout],
        show_layout: Callable[[Layout], None],
        say: Callable[[str], None],
    ) -> None:
        super().__init__("Layout")
        self._layouts = layouts
        self._present = present
        self._show = show_layout
        self._say = say
        self.current = ""  # the name of what was opened or saved last
        self.setAccessibleName("Layouts of the signals")
        self.setToolTip("Plots, curves, span and trigger, kept by name, each in a file")
        menu = QMenu(self)
        menu.aboutToShow.connect(lambda: self.fill(menu))
        self.setMenu(menu)

    def fill(self, menu: QMenu) -> None:
        """List what there is."""
        menu.clear()
        menu.setToolTipsVisible(True)
        names = self._layouts.names()
        for name in names:
            action = menu.addAction(_shown(name))
            action.setCheckable(True)
            action.setChecked(name == self.current)
            action.triggered.connect(lambda _=False, name=name: self.open(name))
        for problem in self._layouts.damaged():
            action = menu.addAction("▲ cannot be read")
            action.setEnabled(False)
            set_tip(action, plain(problem))
        menu.addSeparator()
        menu.addAction("Save as …").triggered.connect(self._ask_name)
        for title, do in (("Rename", self._ask_rename), ("Delete", self._ask_delete)):
            known = self.current in names
            action = menu.addAction(f"{title} {_shown(self.current)} …" if known else f"{title} …")
            action.setEnabled(known)
            action.triggered.connect(do)
        menu.addSeparator()
        menu.addAction("Import a file …").triggered.connect(
            lambda: ask_open(self, "Import a layout", ("toml",), self.take)
        )
        menu.addAction("Export as a file …").triggered.connect(
            lambda: ask_save(self, "Export the layout", "toml", self.give, self.current or UNNAMED)
        )

    def open(self, name: str) -> None:
        """Show this one."""
        self._try(lambda: self._shows(self._layouts.load(name)), f"layout {name}")

    def save(self, name: str) -> None:
        """Save the arrangement under this name."""
        layout = self._present()
        layout.name = name
        self._try(lambda: self._kept(layout), f"layout saved as {' '.join(name.split())}")

    def rename(self, name: str) -> None:
        """Call the one that is shown otherwise."""

        def do() -> None:
            self._layouts.rename(self.current, name)
            self.current = " ".join(name.split())

        self._try(do, f"layout renamed to {' '.join(name.split())}")

    def delete(self) -> None:
        """Forget the one that is shown; what is drawn stays."""
        name = self.current

        def do() -> None:
            self._layouts.delete(name)
            self.current = ""

        self._try(do, f"layout {name} deleted")

    def take(self, path: Path) -> None:
        """Import a file, and show it."""
        self._try(lambda: self._shows(self._layouts.take(path)), f"layout from {path.name}")

    def give(self, path: Path) -> None:
        """Export what is shown."""
        layout = self._present()
        layout.name = self.current or UNNAMED

        def do() -> None:
            write(layout, path)
            read(path)

        self._try(do, f"layout exported as {path.name}")

    def _shows(self, layout: Layout) -> None:
        self._show(layout)
        self.current = layout.name

    def _kept(self, layout: Layout) -> None:
        self._layouts.save(layout)
        self.current = layout.name

    def _try(self, do: Callable[[], None], done: str) -> None:
        try:
            do()
        except (LayoutError, OSError) as error:
            self._say(f"▲ {error}")
        else:
            self._say(done)

    def _ask_name(self) -> None:
        self._ask("Save the layout", "Its name; a layout of the same name is replaced.", "Save", self.save)

    def _ask_rename(self) -> None:
        self._ask("Rename the layout", f"Another name for {self.current}.", "Rename", self.rename)

    def _ask_delete(self) -> None:
        text = f"The layout {self.current} is deleted, with its file. The plots stay as they are."
        ask(self, "Delete the layout", text, "Delete", self.delete)

    def _ask(self, title: str, text: str, action: str, do: Callable[[str], None]) -> None:
        field = QLineEdit(self.current)
        field.setAccessibleName("Name of the layout")
        ask(self, title, text, action, lambda: do(field.text()), field)


def _shown(name: str) -> str:
    return plain(name).replace("&", "&&")
