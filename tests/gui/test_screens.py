"""Pictures of every tab, dark and light, with small and large text, on a small and a large screen.

They are kept in `build/screenshots`, to be looked at. Here it is asked what no picture may lack: STOP is
whole and in sight, nothing is wider than the screen, and the picture is not blank.
"""

import concurrent.futures
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtGui import QImage

from gateway.wire.resource import ProcessUse
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Look, Theme
from tests.gui.archives import Shown, play, record
from tests.gui.fakes import Bench, stop_is_whole
from tests.gui.foreseen import predicted
from tests.support.desk import looked, resources, walking

FOLDER = Path(__file__).parents[2] / "build" / "screenshots"
SMALL, LARGE = ("1366x768", 1366, 768), ("4k", 3840, 2160)
LIGHTLY = 80  # compressed, of 0 (most) to 100


Save = Callable[[QImage, str], None]


@pytest.fixture
def save() -> Iterator[Save]:
    """Saves pictures beside what goes on."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        saving: list[concurrent.futures.Future[bool]] = []
        yield lambda image, name: saving.append(pool.submit(_save, image, FOLDER / name))
        assert all(future.result() for future in saving)


def _save(image: QImage, path: Path) -> bool:
    return image.save(str(path), quality=LIGHTLY)


def busy(bench: Bench) -> None:
    """A robot that walks and has a fault, another without data, predictions, staged edits, processes."""
    bench.add("exo-02", 7421)
    processes = [
        ProcessUse(800 + place, f"process-{place}", 21.4 / (place + 1), 47 << 20) for place in range(30)
    ]
    faulty = looked(state="fault", problem="i²t at 83 % of its limit")
    bench.look_again([faulty, resources(processes), resources()])
    bench.station.edits.stage("gait.step_length", 0.43, bench.station.robot.parameters["gait.step_length"])


def live(bench: Bench, rows: int = 1000) -> None:
    """What a robot that walks has just told, and which is not stale before it has been drawn."""
    bench.station.take([walking(rows, -60.0)])
    bench.station.take_prediction(predicted("walk", {"walk": 0.94, "turn": 0.04, "stand": 0.02}))
    bench.station.take_prediction(predicted("steady", {"steady": 0.99, "fall": 0.01}, "falling"))


def colours(image: QImage) -> set[int]:
    """Of every seventh pixel both ways."""
    as_words = image.convertToFormat(QImage.Format.Format_ARGB32)
    pixels = np.frombuffer(as_words.constBits(), np.uint32).reshape(image.height(), image.width())
    return set(np.unique(pixels[::7, ::7]).tolist())


def title_of(title: str) -> str:
    return re.sub(r"\W", "", title).lower()


@pytest.mark.timeout(600)
@pytest.mark.usefixtures("whole")
@pytest.mark.parametrize(
    ("look", "scale", "screens"),
    [
        (Look.DARK, 0.8, (SMALL,)),
        (Look.LIGHT, 0.8, (SMALL, LARGE)),
        (Look.DARK, 2.0, (SMALL, LARGE)),
        (Look.LIGHT, 2.0, (SMALL,)),
    ],
)
def test_every_tab_is_whole_on_every_screen(
    request: pytest.FixtureRequest,
    bench: Bench,
    theme: Theme,
    save: Save,
    look: Look,
    scale: float,
    screens: tuple[tuple[str, int, int], ...],
) -> None:
    page: Shown = request.getfixturevalue("whole")
    full: MainWindow = request.getfixturevalue("full_window")
    full.setUpdatesEnabled(True)  # it is painted here, too
    busy(bench)
    record(request.getfixturevalue("settings"))
    play(page, request.getfixturevalue("archive"))
    theme.set(look, scale)
    for screen, width, height in screens:
        full.resize(width, height)
        for tab in range(full.tabs.count()):
            full.tabs.setCurrentIndex(tab)
            live(bench)
            page.draw()
            image = full.grab().toImage()
            title = title_of(full.tabs.tabText(tab))
            name = f"{title}-{look.value}-{100 * scale:.0f}-{screen}.png"
            save(image, name)
            assert (full.width(), full.height()) == (width, height), name
            seen = colours(image)
            assert len(seen) > 60, name
            assert theme.colour("window").rgb() in seen, name
        assert stop_is_whole(full)
        full.docks[1].raise_()
        full.parameters.tree.select_name("gait.step_length")
        page.draw()
        save(full.grab().toImage(), f"parameters-{look.value}-{100 * scale:.0f}-{screen}.png")
        panel = full.parameters
        assert panel.rect().contains(panel.review_button.geometry())
        assert panel.tree.viewport().height() >= 4 * panel.tree.sizeHintForRow(0), "some are in sight"
