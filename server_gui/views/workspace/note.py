"""Asks for a note on the time axis."""

from collections.abc import Callable

from PySide6.QtWidgets import QLineEdit, QWidget

from server_gui.core.desk.desk import Desk
from server_gui.core.workspace.notes import LONGEST_NOTE
from server_gui.views.confirmation import ask
from server_gui.views.widgets.time_axis import time_text


def ask_note(
    parent: QWidget, desk: Desk, at_s: float, keep: Callable[[str], None], say: Callable[[str], None]
) -> None:
    """Ask for a note of an instant (s until the newest row); `keep` gets its words, where there are any.

    Who looks at another robot or recording by the time it is written would note it there, at an instant of
    another clock: then none is kept, and `say` tells so.
    """
    station = desk.selected
    source = None if station is None else station.rings.source
    field = QLineEdit()
    field.setMaxLength(LONGEST_NOTE)
    field.setAccessibleName("Note")
    where = f"{time_text(round(at_s, 2))}, where the cursor is" if at_s else "the newest row"
    text = f"Kept with the recording at {where}, and shown on every time axis."

    def done() -> None:
        told = " ".join(field.text().split())
        here = desk.selected
        if told and (here is None or here is not station or here.rings.source is not source):
            say(f"▲ no note, other rows are shown by now: {told}")
        elif told:
            keep(told)

    ask(parent, "Note", text, "Keep", done, field)
