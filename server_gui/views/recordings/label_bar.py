"""Choose a span of a recording, label it, see its labels, take one back."""

from typing import Final

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence, QShortcut
from PySide6.QtWidgets import (
    QComboBox,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from ml.store.labels import ACTIVITIES, INSTANTS, Label
from server_gui.core.archive.label_hits import LabelHits
from server_gui.core.archive.labels import SessionLabels
from server_gui.core.cloud.tape import Tape
from server_gui.views.recordings.timeline import SECOND_NS, Timeline, clock_text
from server_gui.views.theme import Theme
from server_gui.views.widgets.card import set_text
from server_gui.views.widgets.plain import set_tip
from server_gui.views.widgets.shrinking_label import ShrinkingLabel
from server_gui.views.widgets.wrapping_label import WrappingLabel

LIST: Final = 66  # high, at text of 100 %: three labels, as high as the two rows beside it
LABEL_ROLE: Final = Qt.ItemDataRole.UserRole + 1


class LabelBar(QWidget):
    """Bar for labelling the chosen span of the timeline."""

    def __init__(self, labels: SessionLabels, hits: LabelHits, timeline: Timeline, theme: Theme) -> None:
        super().__init__()
        self._hits = hits
        self._labels = labels
        self._timeline = timeline
        self._theme = theme
        self._tape: Tape | None = None
        self._revision = -1
        self.span, self.said = ShrinkingLabel("dim"), WrappingLabel("dim")
        self.right = WrappingLabel("dim")  # of what was predicted
        self.right.hide()
        self.list = QListWidget()
        self.list.setAccessibleName("Labels of this recording")
        self.list.setObjectName("framed")
        self.list.itemActivated.connect(self._look)
        self.list.itemClicked.connect(self._look)
        delete = QShortcut(QKeySequence(Qt.Key.Key_Delete), self.list)
        delete.setContext(Qt.ShortcutContext.WidgetShortcut)
        delete.activated.connect(self._take_back)
        left = QVBoxLayout()
        left.addLayout(self._span_row())
        left.addLayout(self._label_row())
        left.addStretch(1)
        row = QHBoxLayout()
        row.addLayout(left, 3)
        row.addWidget(self.list, 2)
        everything = QVBoxLayout(self)  # texts have all of the width: beside the list they would be cut
        everything.setContentsMargins(0, 0, 0, 0)
        everything.setSpacing(4)
        everything.addLayout(row)
        everything.addWidget(self.said)
        everything.addWidget(self.right)
        theme.changed.connect(self._restyle)
        self._restyle()

    def refresh(self, tape: Tape) -> None:
        """Show how it is now."""
        span = self._timeline.span_ns
        self.span.say(*_span_texts(tape, span))
        self.give.setEnabled(span is not None)
        self.take_back.setEnabled(bool(self.list.selectedItems()))
        if tape is not self._tape or self._revision != self._labels.revision:
            self._tape, self._revision = tape, self._labels.revision
            set_text(self.said, self._labels.said or self._hint())
            self._timeline.show_labels(self._labels.labels)
            self._fill(tape)
        if self.isVisible():
            self._look_for_hits(tape, span)

    def _look_for_hits(self, tape: Tape, span: tuple[int, int] | None) -> None:
        """Say how right predictions were in the span, or in all of it, while labels are looked at."""
        within = span or (tape.first_ns, tape.last_ns + 1)
        self._hits.look(tape.session, within, self._labels.labels)
        set_text(self.right, self._hits.text)
        self.right.setVisible(bool(self._hits.text))

    # --- how it is put together

    def _span_row(self) -> QHBoxLayout:
        begin, end, whole = QPushButton("From here"), QPushButton("To here"), QPushButton("All")
        begin.setAccessibleName("The span begins here (I)")
        end.setAccessibleName("The span ends here (O)")
        whole.setAccessibleName("The span is the whole recording")
        begin.clicked.connect(self._timeline.begin_span)
        end.clicked.connect(self._timeline.end_span)
        whole.clicked.connect(self._timeline.choose_all)
        row = QHBoxLayout()
        row.addWidget(self.span, 1)
        for button in (begin, end, whole):
            set_tip(button, button.accessibleName())
            row.addWidget(button)
        return row

    def _label_row(self) -> QHBoxLayout:
        self.text = QComboBox()
        self.text.setEditable(True)
        self.text.addItems([*ACTIVITIES, *INSTANTS])
        self.text.setCurrentText("walk")
        self.text.setAccessibleName("Label: one of these, or any other word")
        field = self.text.lineEdit()
        if field is not None:
            field.setAccessibleName(self.text.accessibleName())
        self.give, self.take_back = QPushButton("Label span"), QPushButton("Take back")
        self.give.setObjectName("primary")
        self.give.setToolTip("Record that robot and wearer did this in the selected span")
        self.give.clicked.connect(self._give)
        self.take_back.setToolTip("Withdraw the selected label; it stays readable in the history (Delete)")
        self.take_back.clicked.connect(self._take_back)
        row = QHBoxLayout()
        row.addWidget(self.text, 1)
        row.addWidget(self.give)
        row.addWidget(self.take_back)
        return row

    # --- labels

    def _hint(self) -> str:
        if self._labels.labels:
            return "Choose a label to see its span."
        return "No labels yet: choose a span (I begins it, O ends it), then a label."

    def _fill(self, tape: Tape) -> None:
        self.list.clear()
        for label in self._labels.labels:
            item = QListWidgetItem(_line(tape, label))
            item.setData(LABEL_ROLE, label)
            self.list.addItem(item)

    def _give(self) -> None:
        if self._timeline.span_ns is not None:
            self._labels.add(self.text.currentText(), *self._timeline.span_ns)

    def _look(self, item: QListWidgetItem) -> None:
        label: Label = item.data(LABEL_ROLE)
        self._timeline.choose(label.began_utc_ns, label.ended_utc_ns)
        self._timeline.moved.emit(label.began_utc_ns)

    def _take_back(self) -> None:
        for item in self.list.selectedItems():
            self._labels.remove(item.data(LABEL_ROLE))

    def _restyle(self) -> None:
        self.list.setFixedHeight(self._theme.px(LIST))
        self.text.setMinimumWidth(self._theme.px(90))


def _span_texts(tape: Tape, span: tuple[int, int] | None) -> tuple[str, ...]:
    """Return the span, in fewer words where there is less room."""
    if span is None:
        return "No span chosen", "No span"
    begin, end = ((at - tape.first_ns) / SECOND_NS for at in span)
    ends, length = f"{clock_text(begin, 1)}–{clock_text(end, 1)}", f"{end - begin:.1f} s"
    return f"Span {ends} ({length})", f"Span {ends}", ends, length


def _line(tape: Tape, label: Label) -> str:
    begin, end = ((at - tape.first_ns) / SECOND_NS for at in (label.began_utc_ns, label.ended_utc_ns))
    until = f"–{clock_text(end, 1)}" if end > begin else ""
    return f"{clock_text(begin, 1)}{until}  {label.label}  ({label.author}, {label.source.value})"
