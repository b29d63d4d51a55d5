"""Pictures of every tab, dark and light, with small and large text, on a small and a large screen.

They are kept in `build/screenshots`, to be looked at. Here it is asked what no picture may lack: STOP is
whole and in sight, nothing is wider than the screen, and the picture is not blank.
"""

import concurrent.futures
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QApplication

from gateway.messages import ProcessUse
from server_gui.views.main_window import MainWindow
from server_gui.views.theme import Look, Theme
from tests.gui.fakes import Bench, looked, resources, walking

FOLDER = Path(__file__).parents[2] / "build" / "screenshots"
SCREENS = {"1366x768": (1366, 768), "4k": (3840, 2160)}
LIGHTLY = 80  # compressed, of 0 (most) to 100


@pytest.fixture
def writers() -> Iterator[concurrent.futures.Executor]:
    FOLDER.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        yield pool


def busy(bench: Bench) -> None:
    """A robot that walks, another with a fault, staged edits, processes."""
    bench.add("exo-02", 7421)
    processes = [
        ProcessUse(800 + number, f"process-{number}", 21.4 / (number + 1), 47 << 20) for number in range(30)
    ]
    bench.look_again(
        [looked(state="fault", problem="i²t at 83 % of its limit"), resources(processes), resources()]
    )
    bench.station.edits.stage("gait.step_length", 0.43, bench.station.robot.parameters["gait.step_length"])


def colours(image: QImage) -> set[int]:
    return {image.pixel(x, y) for x in range(0, image.width(), 7) for y in range(0, image.height(), 7)}


def save(image: QImage, path: Path) -> None:
    image.save(str(path), b"PNG", LIGHTLY)


def title_of(window: MainWindow, tab: int) -> str:
    return re.sub(r"\W", "", window.tabs.tabText(tab)).lower()


@pytest.mark.timeout(600)
@pytest.mark.parametrize("look", Look)
@pytest.mark.parametrize("scale", [0.8, 2.0])
def test_every_tab_is_whole_on_every_screen(
    window: MainWindow,
    bench: Bench,
    theme: Theme,
    writers: concurrent.futures.Executor,
    look: Look,
    scale: float,
) -> None:
    busy(bench)
    theme.set(look, scale)
    for screen, (width, height) in SCREENS.items():
        window.resize(width, height)
        for tab in range(window.tabs.count()):
            window.tabs.setCurrentIndex(tab)
            bench.station.take([walking(600)])
            bench.draw(window)
            image = window.grab().toImage()
            name = f"{title_of(window, tab)}-{look.value}-{scale:.0%}-{screen}.png".replace("%", "")
            writers.submit(save, image, FOLDER / name)
            assert (window.width(), window.height()) == (width, height), name
            assert len(colours(image)) > 60, name
            assert theme.colour("window").rgb() in colours(image), name
        stop = window.header.stop
        assert window.rect().contains(stop.mapTo(window, stop.rect().topLeft()))
        assert window.rect().contains(stop.mapTo(window, stop.rect().bottomRight()))
        assert stop.width() >= stop.fontMetrics().horizontalAdvance(stop.text())
    QApplication.processEvents()
