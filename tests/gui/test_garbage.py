"""Widgets end in the window's thread, whichever thread makes garbage."""

import threading
import weakref

from PySide6.QtWidgets import QWidget

from server_gui.views.frame.garbage import Garbage


def test_a_widget_that_nobody_needs_ends_in_the_windows_thread(garbage: Garbage) -> None:
    ended: list[threading.Thread] = []
    widget = QWidget()
    weakref.finalize(widget, lambda: ended.append(threading.current_thread()))
    widget.me = widget  # type: ignore[attr-defined]  # a cycle, which only the collector finds
    del widget
    kept: list[list[int]] = []  # as much as makes the collector begin where it is automatic
    other = threading.Thread(target=lambda: kept.extend([number] for number in range(50_000)))
    other.start()
    other.join()
    assert ended == []
    garbage.look()
    assert ended == [threading.current_thread()]
