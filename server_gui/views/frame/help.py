"""Help: the section of the manual that is about what one looks at."""

from PySide6.QtWidgets import QComboBox, QTextBrowser, QVBoxLayout, QWidget

from server_gui.core.desk.manual import sections
from server_gui.views.theme import Theme


class Help(QWidget):
    """A section of the manual, and a choice of the others."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._sections = sections()
        self.setObjectName("page")
        self.choice = QComboBox()
        self.choice.setAccessibleName("Section of the manual")
        self.choice.addItems(list(self._sections))
        self.text = QTextBrowser()
        self.text.setObjectName("framed")
        self.text.setAccessibleName("Manual")
        self.choice.currentTextChanged.connect(self._show)
        everything = QVBoxLayout(self)
        everything.setContentsMargins(8, 8, 8, 8)
        everything.addWidget(self.choice)
        everything.addWidget(self.text, 1)
        theme.changed.connect(self._show_again)
        self._show_again()

    def show_section(self, title: str) -> None:
        """Show the manual's section of this title, or its first section."""
        self.choice.setCurrentIndex(max(0, self.choice.findText(title)))

    def _show_again(self) -> None:
        self._show(self.choice.currentText())

    def _show(self, title: str) -> None:
        self.text.setMarkdown(f"## {title}\n\n{self._sections[title]}")
