"""The tab of recordings: their list, or one of them played."""

from PySide6.QtWidgets import QStackedWidget

from server_gui.core.archive.archive import Archive
from server_gui.core.desk.recording import Recording
from server_gui.views.recordings.player import Player
from server_gui.views.recordings.sessions import SessionsPage
from server_gui.views.theme import Theme


class Recordings(QStackedWidget):
    """The list first."""

    def __init__(self, archive: Archive, recording: Recording, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self.setObjectName("page")
        self.list = SessionsPage(archive, recording, theme)
        self.list.played.connect(self._play)
        self.player = Player(archive, theme)
        self.player.left.connect(lambda: self.setCurrentWidget(self.list))
        self.addWidget(self.list)
        self.addWidget(self.player)

    def refresh(self) -> None:
        """Show how it is now."""
        page = self.player if self.currentWidget() is self.player else self.list
        page.refresh()

    def _play(self) -> None:
        if self._archive.play():
            self.setCurrentWidget(self.player)
            self.player.show_tape()
