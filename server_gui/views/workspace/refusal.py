"""Reason of a refusal, in full, where a line beside the tools would have no room for it."""

from typing import Final

from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.wrapping_label import WrappingLabel

MARK: Final = "▲"  # what begins with it is a refusal


class Refusal(WrappingLabel):
    """Hidden until something is refused, and again after the next thing that is told."""

    def __init__(self) -> None:
        super().__init__("banner")
        self.setProperty("tone", "bad")
        self.hide()

    def take(self, text: str) -> str:
        """Show it where it is a refusal; return what of it is to be said elsewhere."""
        is_refused = text.startswith(MARK)
        set_text(self, text if is_refused else "")
        self.setVisible(is_refused)
        return "" if is_refused or not text else f" · {text}"
