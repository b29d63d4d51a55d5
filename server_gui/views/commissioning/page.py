"""The tab that commissions a robot: a face over `gwrms commission`, which runs in a process of its own."""

from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent, QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QBoxLayout,
    QHBoxLayout,
    QPlainTextEdit,
    QPushButton,
    QSizePolicy,
    QVBoxLayout,
    QWidget,
)

from server_gui.core.commissioning.commissioning import MOST_LINES, Commissioning
from server_gui.core.commissioning.request import CommissioningRequest
from server_gui.core.commissioning.stages import Stage
from server_gui.views.commissioning.bar import Bar
from server_gui.views.commissioning.form import Form
from server_gui.views.commissioning.question import Question
from server_gui.views.commissioning.result import ResultCard
from server_gui.views.commissioning.steps import Steps
from server_gui.views.commissioning.stopped import StoppedCard
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import Card
from server_gui.views.widgets.scroll_area import ScrollArea

NARROW: Final = 760  # at text of 100 %: no room for steps beside the question
LINES: Final = 9  # of what was said, high


class CommissionPage(QWidget):
    """`connect_to` brings the file of a robot that a gateway is to be started for."""

    connect_to = Signal(str)

    def __init__(self, commissioning: Commissioning, theme: Theme) -> None:
        super().__init__()
        self.commissioning = commissioning
        self._theme = theme
        self.setObjectName("page")
        self.form = Form(commissioning.who)
        self.bar = Bar(commissioning, theme, self.form.start)
        self.question, self.steps = Question(commissioning, theme), Steps(theme)
        self.stopped = StoppedCard()
        self.result, self.log = ResultCard(commissioning, theme), Log(commissioning, theme)
        self.bar.stopped.connect(commissioning.stop)
        self.bar.interrupted.connect(commissioning.interrupt)
        self.form.wished.connect(self._start)
        self.question.answered.connect(self._answer)
        self.result.connect_to.connect(self.connect_to)
        left = QVBoxLayout()
        for widget, share in (
            (self.stopped, 0),
            (self.question, 0),
            (self.result, 2),
            (self.form, 0),
            (self.log, 1),
        ):
            left.addWidget(widget, share)
        left.addStretch(0)  # while nothing was said
        self._columns = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        self._columns.addLayout(left, 3)
        self._columns.addWidget(self.steps, 2)
        inner = QWidget()
        inner.setObjectName("page")
        inner.setLayout(self._columns)
        self._columns.setContentsMargins(8, 8, 8, 8)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(0, 0, 0, 0)
        everything.setSpacing(0)
        everything.addWidget(self.bar)
        everything.addWidget(ScrollArea(inner), 1)
        self.refresh()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        is_narrow = self.width() < self._theme.px(NARROW)
        direction = QBoxLayout.Direction
        self._columns.setDirection(direction.TopToBottom if is_narrow else direction.LeftToRight)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Take Return for a STOP while a joint is under power, as in a terminal."""
        keys = (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Escape)
        if event.key() in keys and self.commissioning.stage is Stage.MOVING:
            self.commissioning.stop()
        else:
            super().keyPressEvent(event)

    def refresh(self) -> None:
        """Show how it is now; what has come was taken by whoever looks at it, also while this is not seen."""
        now = self.commissioning
        self.bar.refresh()
        self.form.setVisible(not now.runs)
        if not now.runs:
            self.form.refresh()
            self.form.start.setEnabled(now.can_start)
        self.question.setVisible(now.question is not None)
        self.question.refresh()
        self.steps.show_steps(now.steps, runs=now.runs)
        self.stopped.show_proof(now.proof, now.off)
        self.result.refresh()
        self.log.setVisible(now.logged > 0)
        self.log.refresh()

    def _answer(self, text: str) -> None:
        """Send the answer, and keep the keyboard focus for the next question."""
        if self.commissioning.answer(text):
            self.setFocus()

    def _start(self, wish: CommissioningRequest) -> None:
        self.commissioning.start(wish)
        self.setFocus()  # the form goes: the keyboard waits for the first question, and is on no button
        self.result.say("", again=True)
        self.refresh()


class Log(Card):
    """Log of the dialogue; its text can be selected and copied."""

    def __init__(self, commissioning: Commissioning, theme: Theme) -> None:
        super().__init__("What was said")
        self._commissioning = commissioning
        self._theme = theme
        self._shown = 0
        self._follows = True  # what comes; not while somebody reads what was
        self.text = QPlainTextEdit()
        self.text.setObjectName("framed")
        self.text.setReadOnly(True)
        self.text.setTabChangesFocus(True)
        self.text.setMaximumBlockCount(MOST_LINES)
        self.text.setAccessibleName("What was said, asked and answered")
        self.text.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.copy = QPushButton("Copy all")
        self.copy.clicked.connect(lambda: QApplication.clipboard().setText(self.text.toPlainText()))
        row = QHBoxLayout()
        row.addStretch(1)
        row.addWidget(self.copy)
        self.body.addWidget(self.text, 1)
        self.body.addLayout(row)
        bar = self.text.verticalScrollBar()
        bar.valueChanged.connect(self._scrolled)
        bar.rangeChanged.connect(self._follow)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self) -> None:
        """Add what has come; who has scrolled up stays there."""
        now = self._commissioning
        new = min(now.logged - self._shown, len(now.log))
        if new <= 0:
            return
        self._shown = now.logged
        follows = self._follows
        self.text.appendPlainText("\n".join(list(now.log)[-new:]))
        self._follows = follows
        self._follow()

    def _scrolled(self, value: int) -> None:
        self._follows = value >= self.text.verticalScrollBar().maximum() - 1

    def _follow(self) -> None:
        """Also where there is less room than before."""
        if self._follows:
            bar = self.text.verticalScrollBar()
            bar.setValue(bar.maximum())

    def _restyle(self) -> None:
        self.text.setFont(self._theme.number_font())
        self.text.setMinimumHeight(self.text.fontMetrics().lineSpacing() * LINES)
