"""Menu of companions beside the shown robot: another robot, or the recording that is played."""

from collections.abc import Callable, Sequence

from PySide6.QtWidgets import QLineEdit, QMenu, QPushButton

from server_gui.core.archive.archive import Archive
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.station import Station
from server_gui.core.workspace.alignment import Align
from server_gui.core.workspace.scene import Scene
from server_gui.views.confirmation import ask
from server_gui.views.workspace.curve_menus import shown

MOST_S = 1e6


class BesideMenu(QPushButton):
    """`stations` gives who can be beside; `say` tells what was typed wrong."""

    def __init__(
        self, scene: Scene, stations: Callable[[], Sequence[Station]], say: Callable[[str], None]
    ) -> None:
        super().__init__("Beside")
        self._scene = scene
        self._stations = stations
        self._say = say
        self.setAccessibleName("Show another robot, or a recording, beside this one")
        self.setToolTip("Another robot, or the recording that is played, in the same plots, thin")
        menu = QMenu(self)
        menu.aboutToShow.connect(lambda: self.fill(menu))
        self.setMenu(menu)

    def fill(self, menu: QMenu) -> None:
        """List who there is, and what both may be aligned by."""
        menu.clear()
        scene = self._scene
        beside = None if scene.beside is None else scene.beside.station
        nothing = menu.addAction("Nothing")
        nothing.setCheckable(True)
        nothing.setChecked(beside is None)
        nothing.triggered.connect(lambda: scene.put_beside(None))
        stations = self._stations()
        for station in stations:
            action = menu.addAction(shown(_named(station)))
            action.setCheckable(True)
            action.setChecked(station is beside)
            action.triggered.connect(lambda _=False, station=station: scene.put_beside(station))
        if not stations:
            menu.addAction("There is no other robot, and no recording is played").setEnabled(False)
        menu.addSeparator()
        aligned = menu.addMenu("Align by")
        aligned.setEnabled(beside is not None)
        for by in Align:
            action = aligned.addAction(by.value)
            action.setCheckable(True)
            action.setChecked(by is scene.align)
            action.triggered.connect(lambda _=False, by=by: self._align(by))
        move = menu.addAction("Move it by …")
        move.setEnabled(beside is not None)
        move.triggered.connect(self._ask)

    def nudge(self, text: str) -> None:
        """Move it by so many seconds, to the right where they are more than 0."""
        try:
            seconds = float(text.replace("−", "-"))
        except ValueError:
            seconds = float("nan")
        if not abs(seconds) <= MOST_S:
            self._say(f"▲ {text!r} is not a number of seconds: write one such as −0.25")
            return
        self._scene.nudge_s = seconds

    def _align(self, by: Align) -> None:
        self._scene.align = by

    def _ask(self) -> None:
        field = QLineEdit(f"{self._scene.nudge_s:g}")
        field.setAccessibleName("Offset in seconds")
        text = "Seconds to the right; to the left with −."
        ask(self, "Move what is beside", text, "Move", lambda: self.nudge(field.text()), field)


def _named(station: Station) -> str:
    return f"recording of {station.title}" if station.robot.is_recording else station.title


def others_of(desk: Desk, archive: Archive | None) -> list[Station]:
    """Return possible companions of the shown robot: other robots, and the recording being played."""
    played = [] if archive is None else archive.playback.desk.stations
    return [*(one for one in desk.stations if one is not desk.selected), *played]
