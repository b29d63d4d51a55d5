"""A window whose thread is held up until a file appears: what a STOP key does meanwhile is what is tested.

`python busy_window.py HOST:PORT FOLDER` says `ready`, how it hears of keys, its number, and where STOP is
on the screen. It holds its thread as soon as FOLDER/hold is there, until FOLDER/free; ends with FOLDER/end.
FOLDER/NAME.at gets the place of whatever of `places` can be clicked, when FOLDER/NAME.where is there.
"""

import contextlib
import sys
import time
from pathlib import Path

from PySide6.QtCore import QPoint, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from server_gui.app import FOLLOWING, App, stop_keys
from server_gui.core.settings.server_file import ServerSettings, add_robots
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.tree import NEW

LOOK_S = 0.005
LONGEST_S = 30.0


def places(window: MainWindow) -> dict[str, QPoint]:
    """Where a hand would click."""
    panel = window.parameters
    tree, field = panel.tree, panel.tree.currentIndex().siblingAtColumn(NEW)
    found = {"field": tree.viewport().mapToGlobal(tree.visualRect(field).center())}
    buttons = {"review": panel.review_button, "write": panel.review.write_it}
    return found | {
        name: button.mapToGlobal(button.rect().center())
        for name, button in buttons.items()
        if button.isVisible() and button.isEnabled()
    }


def main(address: str, folder: Path) -> None:
    qt = QApplication([])
    kept = QSettings(str(folder / "kept.ini"), QSettings.Format.IniFormat)
    settings = add_robots(ServerSettings(), {"robot": address})

    def look() -> None:
        if (folder / "hold").exists() and not (folder / "free").exists():
            (folder / "held").touch()
            deadline = time.monotonic() + LONGEST_S
            while not (folder / "free").exists() and time.monotonic() < deadline:
                time.sleep(LOOK_S)
        for asked in folder.glob("*.where"):
            app.window.parameters.tree.select_name("gait.step_length")
            at = places(app.window).get(asked.stem)
            if at is not None:
                asked.rename(asked.with_suffix(".asked"))
                asked.with_suffix(".part").write_text(f"{at.x()} {at.y()}", encoding="utf-8")
                asked.with_suffix(".part").rename(asked.with_suffix(".at"))
        if (folder / "end").exists():
            app.window.close()

    with App(qt, settings, kept, FOLLOWING) as app:
        app.window.resize(1380, 860)
        app.window.show()
        app.tick()
        qt.processEvents()
        timer = QTimer(interval=20)
        timer.timeout.connect(look)
        timer.start()
        with stop_keys(qt, app) as keys:
            app.window.activateWindow()
            kind = "qt" if keys is None else "x11"
            stop = app.window.header.stop
            middle = stop.mapToGlobal(stop.rect().center())
            sys.stdout.write(f"ready {kind} {int(app.window.winId())} {middle.x()} {middle.y()}\n")
            sys.stdout.flush()
            qt.exec()


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt):
        main(sys.argv[1], Path(sys.argv[2]))
