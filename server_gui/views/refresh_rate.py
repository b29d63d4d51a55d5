"""The rate at which text in a window is refreshed: now and then, and at once when its subject changes."""

from typing import Final

from server_gui.core.follow.frame_time import now_ns

SLOW: Final = 6  # frames between two looks at what people read
READ_NS: Final = 200_000_000  # and the longest between them, where frames are slow


class RefreshRate:
    """Asked once a frame."""

    def __init__(self) -> None:
        self._frame = 0
        self._read_ns = 0
        self._about: object = None

    def hurry(self) -> None:
        """Let it be due with the next frame."""
        self._read_ns = 0

    def is_due(self, about: object) -> bool:
        """Return whether it is time; `about` is what it would be about."""
        self._frame += 1
        late = now_ns() - self._read_ns >= READ_NS
        due = self._frame % SLOW == 0 or late or about != self._about
        self._about = about
        if due:
            self._read_ns = now_ns()
        return due
