"""The tab of recordings: their list, one of them played, or two of them compared."""

from PySide6.QtWidgets import QStackedWidget

from server_gui.core.archive.archive import Archive
from server_gui.core.desk.recording import Recording
from server_gui.views.recordings.comparison import ComparisonPage
from server_gui.views.recordings.player import Player
from server_gui.views.recordings.sessions import SessionsPage
from server_gui.views.theme import Theme
from server_gui.views.widgets.lazy_view import LazyView
from server_gui.views.widgets.scroll_area import ScrollArea

LIST, PLAYER, CHANGED = range(3)


class Recordings(QStackedWidget):
    """The list first."""

    def __init__(self, archive: Archive, recording: Recording, theme: Theme) -> None:
        super().__init__()
        self._archive = archive
        self._theme = theme
        self.setObjectName("page")
        self.list = SessionsPage(archive, recording, theme)
        self.list.played.connect(self._play)
        self.list.beside.connect(self._play_beside)
        self.list.compared.connect(lambda: self.setCurrentIndex(CHANGED))
        self._player = LazyView(self._make_player)
        self._changed = LazyView(self._make_changed)
        # Each is scrolled by itself, else a low one is as high as the other likes.
        for page in (ScrollArea(self.list), self._player, self._changed):
            self.addWidget(page)

    @property
    def player(self) -> Player:
        return self._player.view

    @property
    def changed(self) -> ComparisonPage:
        return self._changed.view

    @property
    def is_played(self) -> bool:
        """Whether one is played, rather than listed or compared."""
        return self.currentIndex() == PLAYER

    def refresh(self) -> None:
        """Show how it is now."""
        if self.currentIndex() == LIST:
            self.list.refresh()
        else:
            (self.player if self.currentIndex() == PLAYER else self.changed).refresh()

    def _make_player(self) -> Player:
        made = Player(self._archive, self._theme)
        made.left.connect(lambda: self.setCurrentIndex(LIST))
        return made

    def _make_changed(self) -> ComparisonPage:
        made = ComparisonPage(self._archive, self._theme)
        made.left.connect(lambda: self.setCurrentIndex(LIST))
        return made

    def _play(self) -> None:
        if self._archive.play():
            self.setCurrentIndex(PLAYER)
            self.player.show_tape()
            self._archive.playback.play(on=True)  # as the button says; at its very beginning there is little

    def _play_beside(self) -> None:
        marked = self.list.marked
        self._play()
        if self.currentIndex() == PLAYER and len(marked) == 2:
            self.player.show_beside(marked[1])
