"""The question of the moment: what is asked, choices as buttons, a field with its unit, live values below."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QGridLayout, QHBoxLayout, QLineEdit, QPushButton, QWidget

from gateway.units import with_minus
from server_gui.core.commissioning.commissioning import Commissioning
from server_gui.core.commissioning.messages import Message, mover
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card, set_text
from server_gui.views.widgets.plain import PlainLabel
from server_gui.views.widgets.wrapping_label import WrappingLabel

WORDS: Final = {"y": "Yes", "n": "No"}
IN_ROW: Final = 3  # choices
FIELD: Final = 300  # wide at least, at text of 100 %


class AnswerButton(QPushButton):
    """Return presses it as Space does; a key that is held down answers once."""

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.isAutoRepeat():
            return
        if event.key() in (Qt.Key.Key_Return, Qt.Key.Key_Enter):
            self.click()
        else:
            super().keyPressEvent(event)


class Question(Card):
    """`answered` brings what was chosen or typed."""

    answered = Signal(str)

    def __init__(self, commissioning: Commissioning, theme: Theme) -> None:
        super().__init__("Question")
        self._commissioning = commissioning
        self._theme = theme
        self._shown: Message | None = None
        self.news, self.text = WrappingLabel("dim"), WrappingLabel()
        self.refused = WrappingLabel("banner")
        self.refused.setProperty("tone", "bad")
        self.field, self.unit = QLineEdit(), PlainLabel()
        self.field.returnPressed.connect(self._typed)
        self.send = AnswerButton("Answer")
        self.send.setObjectName("primary")
        self.send.clicked.connect(self._typed)
        self.range = PlainLabel()
        self.range.setObjectName("dim")
        self.buttons: list[AnswerButton] = []
        self._choices = QGridLayout()
        self._choices.setColumnStretch(IN_ROW, 1)
        self._typing = QWidget()
        row = QHBoxLayout(self._typing)
        row.setContentsMargins(0, 0, 0, 0)
        for part in (self.field, self.unit, self.send, self.range):
            row.addWidget(part)
        row.addStretch(1)
        self.live = Live(theme)
        self.body.setSpacing(8)
        for widget in (self.news, self.text, self.refused, self._typing):
            self.body.addWidget(widget)
        self.body.addLayout(self._choices)
        self.body.addWidget(self.live)
        self.body.addStretch(1)
        theme.changed.connect(self._restyle)
        self._restyle()
        self.refresh()

    def refresh(self) -> None:
        """Show the question, once it may be answered its buttons, and what devices tell."""
        question = self._commissioning.question
        if question is not self._shown:
            self._shown = question
            self._ask(question)
        can = self._commissioning.can_answer
        if self.send.isEnabled() != can:
            for button in (self.send, *self.buttons):
                button.setEnabled(can)
            if can:
                self._lead()
        self.live.show_readings(self._commissioning)

    # --- inside

    def _ask(self, question: Message | None) -> None:
        news = [one for one in self._commissioning.news if question is None or one != question.refused]
        set_text(self.news, "\n".join(news))
        self.news.setVisible(bool(news))
        set_text(self.text, "" if question is None else question.question)
        set_text(self.refused, "" if question is None else question.refused)
        self.refused.setVisible(bool(self.refused.text()))
        self._offer(question)
        typed = None if question is None or question.choices or question.press else question
        self._typing.setVisible(typed is not None)
        if typed is not None:
            self.field.setText(typed.default or "")
            self.field.setAccessibleName(f"Answer: {typed.question}")
            set_text(self.unit, typed.unit)
            set_text(self.range, with_minus(typed.range))
        self.unit.setVisible(bool(self.unit.text()))
        self.range.setVisible(bool(self.range.text()))
        self.send.setEnabled(False)

    def _offer(self, question: Message | None) -> None:
        for button in self.buttons:
            self._choices.removeWidget(button)
            button.hide()
            button.deleteLater()
        choices = () if question is None else ("",) if question.press else question.choices
        self.buttons = [self._button(choice, question) for choice in choices]
        for place, button in enumerate(self.buttons):
            self._choices.addWidget(button, place // IN_ROW, place % IN_ROW)

    def _button(self, choice: str, question: Message | None) -> AnswerButton:
        button = AnswerButton(WORDS.get(choice, choice.capitalize()) if choice else "Done")
        button.setAccessibleName(f"Answer: {button.text()}")
        if not choice or (question is not None and choice == question.default):
            button.setObjectName("primary")
        button.setEnabled(False)
        button.clicked.connect(lambda: self.answered.emit(choice))
        return button

    def _lead(self) -> None:
        """Move the focus to the answer, if it was on the last question or nowhere."""
        focused = QApplication.focusWidget()
        ours = focused is None or focused.isAncestorOf(self) or self.isAncestorOf(focused)
        if not self.isVisible() or not ours:
            return
        first = next((one for one in self.buttons if one.objectName() == "primary"), None)
        if first is not None:
            first.setFocus()
        elif self.buttons:
            self.buttons[0].setFocus()
        elif self._typing.isVisible():
            self.field.setFocus()
            if not self.field.isModified():  # else the next key would be instead of those that were typed
                self.field.selectAll()

    def _typed(self) -> None:
        if self._commissioning.can_answer:
            self.answered.emit(self.field.text())

    def _restyle(self) -> None:
        self.text.setFont(self._theme.text_font(1.3))
        self.field.setFont(self._theme.text_font(1.3))
        self.unit.setFont(self._theme.text_font(1.3))
        self.field.setMinimumWidth(self._theme.px(FIELD) // 2)


class Live(QWidget):
    """Live values while a joint is moved by hand, a line each; old ones are hidden."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setAccessibleName("What the drives tell now")
        self._rows: list[tuple[PlainLabel, WrappingLabel]] = []
        self._moved: list[bool] = []  # of each row, whether its drive has
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 4, 0, 0)
        self._grid.setColumnStretch(1, 1)
        self._grid.setHorizontalSpacing(14)
        theme.changed.connect(self._restyle)

    @property
    def texts(self) -> list[tuple[str, str]]:
        """The shown texts."""
        return [(name.text(), value.text()) for name, value in self._rows if not name.isHidden()]

    def show_readings(self, commissioning: Commissioning) -> None:
        """Show these, each device's in one line."""
        told: dict[str, list[str]] = {}
        for reading in commissioning.live:
            told.setdefault(reading.name, []).append(reading.text)
        while len(self._rows) < len(told):
            self._add()
        lines, moved = list(told.items()), mover(commissioning.live)
        for place, (name, value) in enumerate(self._rows):
            known = place < len(lines)
            name.setVisible(known)
            value.setVisible(known)
            if known:
                set_text(name, lines[place][0])
                texts = lines[place][1]
                has_moved = lines[place][0] == moved
                set_text(value, " · ".join([*texts, "✓"] if has_moved else texts))
                self._mark(place, has_moved=has_moved)
        self.setVisible(bool(lines))

    def _add(self) -> None:
        name, value = PlainLabel(), WrappingLabel()
        self._moved.append(False)
        name.setObjectName("dim")
        self._grid.addWidget(name, len(self._rows), 0, Qt.AlignmentFlag.AlignTop)
        self._grid.addWidget(value, len(self._rows), 1)
        self._rows.append((name, value))
        self._restyle()

    def _mark(self, place: int, *, has_moved: bool) -> None:
        """Have the drive that has moved enough in bold."""
        if self._moved[place] is not has_moved:
            self._moved[place] = has_moved
            self._restyle()

    def _restyle(self) -> None:
        for (name, value), is_bold in zip(self._rows, self._moved, strict=True):
            name.setFont(
                self._theme.text_font(1.1, bold=is_bold)
            )  # as high as its value, on one line with it
            font = self._theme.number_font(1.1)
            font.setBold(is_bold)
            value.setFont(font)
