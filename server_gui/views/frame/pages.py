"""The pages in the middle: those of the robot that is looked at, what is kept, and commissioning."""

from collections.abc import Callable, Sequence
from typing import Final, Protocol, TypeVar, cast

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QTabWidget, QWidget

from server_gui.core.archive.archive import Archive
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.desk.desk import Desk
from server_gui.views.audit.page import Audit
from server_gui.views.cloud.panel import Cloud
from server_gui.views.commissioning.page import CommissionPage
from server_gui.views.edits.page import Edits
from server_gui.views.models.panel import ModelsPage
from server_gui.views.objects.panel import ObjectsPage
from server_gui.views.overview.page import Overview
from server_gui.views.recordings.panel import Recordings
from server_gui.views.resources.bus_health import BusHealthView
from server_gui.views.resources.page import Resources
from server_gui.views.theme import Theme
from server_gui.views.widgets.lazy_view import LazyView
from server_gui.views.workspace.beside_menu import others_of
from server_gui.views.workspace.page import Signals

V = TypeVar("V", bound=QWidget)
OF_A_ROBOT: Final = 7  # pages, which come first


class View(Protocol):
    """Contents of a page."""

    def refresh(self) -> None:
        """Show how it is now; called each frame while the page is visible."""
        ...


class Pages(QTabWidget):
    """Each is made when it is first looked at or asked for: all take longer than the rest of the window.

    `tried_again` brings the values (SI) of a trial that was too short to be judged.
    `edited` brings the name of a parameter that somebody wants to change, `connect_to` the file of a robot
    that a gateway is to be started for.
    """

    edited = Signal(str)
    tried_again = Signal(object)
    connect_to = Signal(str)

    def __init__(
        self,
        desk: Desk,
        theme: Theme,
        archive: Archive | None,
        commissioning: Commissioning | None,
    ) -> None:
        super().__init__()
        self._desk, self._theme = desk, theme
        self.setAccessibleName("Views")
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # it would give it to its own bar, which is not shown
        step = None if archive is None else archive.playback.step
        journals = None if archive is None else archive.journals
        self._rooms: list[LazyView[QWidget]] = []
        self._overview = self._add("&Overview", self._make_overview)
        self._signals = self._add(
            "&Signals",
            lambda: Signals(desk, theme, others=lambda: others_of(desk, archive), step=step),
        )
        self._resources = self._add("&Resources", lambda: Resources(desk, theme))
        self._buses = self._add("&Bus", lambda: BusHealthView(desk, theme))
        self._objects = self._add("Ob&jects", self._make_objects)
        self._audit = self._add("&Audit", lambda: Audit(desk, theme, journals))
        self._edits = self._add("&Edits", self._make_edits)
        if archive is not None:
            kept = archive
            self._recordings = self._add(
                "Re&cordings", lambda: Recordings(kept, desk.recording, theme), scrolled=False
            )
            self._cloud = self._add("C&loud", lambda: Cloud(kept, desk.recording, theme))
            self._models = self._add("&Models", lambda: ModelsPage(kept.models, theme, desk))
        if commissioning is not None:
            new = commissioning
            self._commission = self._add("Commissio&n", lambda: self._make_commission(new), scrolled=False)

    @property
    def overview(self) -> Overview:
        return self._overview.view

    @property
    def signals(self) -> Signals:
        return self._signals.view

    @property
    def resources(self) -> Resources:
        return self._resources.view

    @property
    def buses(self) -> BusHealthView:
        return self._buses.view

    @property
    def objects(self) -> ObjectsPage:
        return self._objects.view

    @property
    def audit(self) -> Audit:
        return self._audit.view

    @property
    def edits(self) -> Edits:
        return self._edits.view

    @property
    def recordings(self) -> Recordings:
        return self._recordings.view

    @property
    def cloud(self) -> Cloud:
        return self._cloud.view

    @property
    def models(self) -> ModelsPage:
        return self._models.view

    @property
    def commission(self) -> CommissionPage:
        return self._commission.view

    @property
    def view(self) -> View:
        """That in front."""
        return cast("View", self._rooms[self.currentIndex()].view)

    @property
    def shows_playback(self) -> bool:
        """Whether a recording is played in front."""
        room = self._rooms[self.currentIndex()]
        return room.is_made and isinstance(room.view, Recordings) and room.view.is_played

    @property
    def is_of_a_robot(self) -> bool:
        """Whether that in front shows the robot that is looked at."""
        return self.currentIndex() < OF_A_ROBOT

    def look_at(self, view: QWidget) -> None:
        """Bring one to the front."""
        self.setCurrentIndex(
            next(at for at, room in enumerate(self._rooms) if room.is_made and room.view is view)
        )

    def look_at_recordings(self) -> None:
        """Bring what is kept to the front."""
        self.setCurrentIndex(OF_A_ROBOT)

    def look_at_commissioning(self) -> None:
        """Bring the page of robots that have no file yet to the front."""
        self.setCurrentIndex(self.count() - 1)

    def open_channels(self, channels: Sequence[str]) -> None:
        """Show these in `signals`."""
        self.look_at(self.signals)
        self.signals.refresh()
        self.signals.choose(channels)

    def read_now(self) -> None:
        """Let the next frame say also what is read."""
        for room in (self._overview, self._signals, self._resources, self._buses):
            if room.is_made:
                room.view.read_now()

    def _add(self, title: str, make: Callable[[], V], *, scrolled: bool = True) -> LazyView[V]:
        room = LazyView(make, scrolled=scrolled)
        self._rooms.append(cast("LazyView[QWidget]", room))
        self.addTab(room, title)
        return room

    def _make_overview(self) -> Overview:
        made = Overview(self._desk, self._theme)
        made.is_paced = False
        made.opened.connect(self.open_channels)
        made.now.compare.connect(lambda station: self.edits.compare(station))
        return made

    def _make_edits(self) -> Edits:
        made = Edits(self._desk, self._theme)
        made.again.connect(self.tried_again)
        return made

    def _make_objects(self) -> ObjectsPage:
        made = ObjectsPage(self._desk, self._theme)
        made.edited.connect(self.edited)
        return made

    def _make_commission(self, commissioning: Commissioning) -> CommissionPage:
        made = CommissionPage(commissioning, self._theme)
        made.connect_to.connect(self.connect_to)
        return made
