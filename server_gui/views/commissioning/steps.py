"""The list of steps: the robot's own and each joint's, which are done, which is gone through, which come."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QGridLayout, QWidget

from server_gui.core.alarms.marks import GLYPHS, Mark
from server_gui.core.commissioning.messages import StepMessage
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.mark import MarkIcon
from server_gui.views.widgets.wrapping_label import WrappingLabel

DONE, NOW, NEXT, PASSED = "done", "now", "next", "passed"
MARKS: Final = {
    NOW: Mark("diamond", "accent", "now"),
    DONE: Mark("disc", "good", "done"),
    PASSED: Mark("cross", "dim", "left out"),
    NEXT: Mark("ring", "dim", "next"),
}
NONE: Final = (
    "They are listed once it runs: name, bus and joints of the robot, eight steps a joint, sensors, the file."
)


class Steps(Card):
    """A line each part; with every step in words, of the one that is gone through."""

    def __init__(self, theme: Theme) -> None:
        super().__init__("Steps")
        self._theme = theme
        self._known: tuple[StepMessage, ...] | None = None
        self._rows: list[tuple[MarkIcon, WrappingLabel, WrappingLabel]] = []
        self.none = WrappingLabel("dim")
        self.none.setText(NONE)
        inner = QWidget()
        self._grid = QGridLayout(inner)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setColumnStretch(1, 1)
        self._grid.setVerticalSpacing(1)
        self.body.addWidget(self.none)
        self.body.addWidget(inner)
        self.body.addStretch(1)

    @property
    def texts(self) -> list[str]:
        """The shown texts, part by part."""
        return [f"{title.text()}: {words.text()}" for _, title, words in self._rows if not title.isHidden()]

    def show_steps(self, steps: tuple[StepMessage, ...], *, runs: bool) -> None:
        """Show these; where it does not run, none is gone through."""
        if not runs:
            steps = tuple(
                StepMessage(one.part, one.title, NEXT if one.state == NOW else one.state) for one in steps
            )
        if steps == self._known:
            return
        self._known = steps
        parts = _parts(steps)
        self.none.setVisible(not parts)
        while len(self._rows) < len(parts):
            self._add()
        for place, (icon, title, words) in enumerate(self._rows):
            for widget in (icon, title, words):
                widget.setVisible(place < len(parts))
            if place < len(parts):
                name, its = parts[place]
                icon.show_mark(MARKS[_state(its)])
                set_text(title, name.replace("_", " "))
                set_text(words, _told(its))
                words.setVisible(bool(words.text()))
        done = sum(one.state in (DONE, PASSED) for one in steps)
        self.set_note(*((f"{done} of {len(steps)} done", f"{done}/{len(steps)}") if steps else ("",)))

    def _add(self) -> None:
        icon, title, words = MarkIcon(self._theme), WrappingLabel("title"), WrappingLabel("dim")
        row = 2 * len(self._rows)
        self._grid.addWidget(icon, row, 0, Qt.AlignmentFlag.AlignVCenter)
        self._grid.addWidget(title, row, 1)
        self._grid.addWidget(words, row + 1, 1)
        self._rows.append((icon, title, words))


def _parts(steps: tuple[StepMessage, ...]) -> list[tuple[str, list[StepMessage]]]:
    """Return steps that follow each other in one part."""
    parts: list[tuple[str, list[StepMessage]]] = []
    for step in steps:
        if not parts or parts[-1][1][-1].part != step.part:
            parts.append((step.part, []))
        parts[-1][1].append(step)
    return parts


def _state(steps: list[StepMessage]) -> str:
    """Return the state of a part: done only if each step is, or was passed after one that is."""
    states = {step.state for step in steps}
    if NOW in states:
        return NOW
    if NEXT in states:
        return NEXT
    return DONE if DONE in states else PASSED


def _told(steps: list[StepMessage]) -> str:
    """Return every step of the part that is gone through; of another one what is not as its mark says."""
    state = _state(steps)
    if state == NOW:
        return "\n".join(f"{_glyph(one.state)} {one.title}" for one in steps)
    other = [one.title for one in steps if one.state == (DONE if state == NEXT else PASSED)]
    words = "done already" if state == NEXT else "without a finding"
    return f"{words}: {', '.join(other)}" if other and len(other) < len(steps) else ""


def _glyph(state: str) -> str:
    return GLYPHS[MARKS.get(state, MARKS[NEXT]).shape]
