"""A window whose thread is held up until a file appears: what a STOP key does meanwhile is what is tested.

`python busy_window.py HOST:PORT FOLDER` says `ready`, how it hears of keys, its number, and where STOP is
on the screen. It holds its thread as soon as FOLDER/hold is there, until FOLDER/free; ends with FOLDER/end.
"""

import contextlib
import sys
import time
from pathlib import Path

from PySide6.QtCore import QSettings, QTimer
from PySide6.QtWidgets import QApplication

from server_gui.app import FOLLOWING, App, stop_keys
from server_gui.core.settings import ServerSettings, add_robots

LOOK_S = 0.005
LONGEST_S = 30.0


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
