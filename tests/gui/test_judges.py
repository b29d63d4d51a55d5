"""The wearers that a training may be judged by."""

from PySide6.QtCore import QRect

from server_gui.core.models.lessons import Lesson, Lessons
from server_gui.views.models.judges import LABELLED, NAME, WRAPPED, Judges
from server_gui.views.theme import Theme
from tests.gui.fakes import destroy

SESSION = "20261129T022706Z-f88741"


def test_names_are_whole_and_what_is_labelled_has_as_many_lines_as_it_needs(theme: Theme) -> None:
    judges = Judges(theme)
    judges.resize(420, 200)
    judges.show()
    many = {"walk": 50, "sit to stand": 34, "stand": 32, "stairs up": 128}
    each = (Lesson(SESSION, SESSION, False, 1, many, 0.1), Lesson("s0", "s0", True, 1, {"walk": 79}, 0.1))
    judges.show_lessons(Lessons(each))
    item, other = judges._items()
    metrics, name = judges.fontMetrics(), judges.visualItemRect(item)
    assert judges.columnWidth(NAME) > metrics.horizontalAdvance(SESSION)
    box = QRect(0, 0, judges.columnWidth(LABELLED) - 6, 1000)
    assert name.height() >= metrics.boundingRect(box, WRAPPED, item.text(LABELLED)).height()
    assert name.height() > judges.visualItemRect(other).height()
    assert judges.verticalScrollBar().maximum() == 0, "each is in sight"
    destroy(judges)
