"""The tab of recordings: their list, one of them played, or two of them compared."""

from PySide6.QtWidgets import QStackedWidget

from server_gui.core.archive.archive import Archive
from server_gui.core.desk.recording import Recording
from server_gui.views.recordings.changed import ChangedPage
from server_gui.views.recordings.player import Player
from server_gui.views.recordings.sessions import SessionsPage
from server_gui.views.theme import Theme
from server_gui.views.widgets.scrolled import Scrolled

LIST, PLAYER, CHANGED = range(3)


class Recordings(QStackedWidget):
    """The list first."""

    def __init__(self, archive: Archive, recording: Recording, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self.setObjectName("page")
        self.list = SessionsPage(archive, recording, theme)
        self.list.played.connect(self._play)
        self.player = Player(archive, theme)
        self.player.left.connect(lambda: self.setCurrentIndex(LIST))
        self.changed = ChangedPage(archive, theme)
        self.changed.left.connect(lambda: self.setCurrentIndex(LIST))
        self.list.compared.connect(lambda: self.setCurrentIndex(CHANGED))
        for page in (
            self.list,
            self.player,
            self.changed,
        ):  # each by itself, else a low one is as high as the other likes
            self.addWidget(Scrolled(page))

    def refresh(self) -> None:
        """Show how it is now."""
        (self.list, self.player, self.changed)[self.currentIndex()].refresh()

    def _play(self) -> None:
        if self._archive.play():
            self.setCurrentIndex(PLAYER)
            self.player.show_tape()
