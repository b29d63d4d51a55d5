"""An alarm of a busy computer leads to the page that shows what keeps it busy."""

import dataclasses

from msgspec.structs import replace

from server_gui.views.frame.main_window import MainWindow
from tests.gui.fakes import Bench
from tests.support.desk import looked, resources


def test_an_alarm_of_a_busy_computer_leads_to_its_page_and_names_no_command(
    window: MainWindow, bench: Bench
) -> None:
    """It said "gwrms blame", in a window that has a page for that."""
    seen = resources()
    snapshot = replace(seen.snapshot, cpu=replace(seen.snapshot.cpu, percent=97.0))
    bench.look_again([dataclasses.replace(seen, snapshot=snapshot), looked(state="lost", problem="late")])
    bench.draw(window)
    strip = window.alarms
    assert "gwrms blame" not in "\n".join(strip.texts)
    assert "on the page Resources" in strip.texts[0]
    assert strip.buttons.show_resources.isVisible()
    strip.buttons.show_resources.click()
    assert window.tabs.currentWidget() is not None
    assert window.tabs.tabText(window.tabs.currentIndex()).replace("&", "") == "Resources"
