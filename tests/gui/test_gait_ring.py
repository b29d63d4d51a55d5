"""The ring of the gait says what it can, in letters that are read, whatever its size."""

import numpy as np
import numpy.typing as npt
import pytest
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QWidget

from server_gui.core.desk.leg_phase import LegPhase
from server_gui.core.processing.gait_events import Leg
from server_gui.views.theme import Theme
from server_gui.views.widgets.gait_ring import GaitRing, Phases
from tests.gui.fakes import destroy


@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
def test_the_ring_says_what_the_wearer_does_however_small_it_is(theme: Theme, scale: float) -> None:
    theme.set(scale=scale)
    ring = GaitRing(theme)
    ring.resize(ring.minimumSizeHint().expandedTo(ring.minimumSize()))
    known: Phases = dict.fromkeys(Leg, LegPhase(30.0, "mid-stance"))
    for word, least in (("Walk 94 %", "Walk"), ("Stopped", "Stopped"), ("Turn 61 %", "Turn")):
        ring.show_phases(known, known, word, "120 steps/min", live=True)
        assert (ring.read[0], ring.read[-1]) == ("L 30 %", "R 30 %"), scale
        assert ring.read[1].startswith(least), scale
    ring.show_phases(dict.fromkeys(Leg), dict.fromkeys(Leg), "Not known", "", live=False)
    assert " ".join(ring.read) == "Not known"
    ring.setFixedSize(theme.px(400), theme.px(400))
    ring.show_phases(known, known, "Walk 94 %", "120 steps/min", live=True)
    assert ring.read[:2] == ["Walk 94 %", "120 steps/min"]
    destroy(ring)


@pytest.mark.parametrize(
    ("scale", "side"), [(1.0, 90), (1.5, 90), (1.0, 130), (1.0, 180), (1.0, 240), (2.0, 160)]
)
def test_words_in_the_ring_touch_it_nowhere(
    theme: Theme, monkeypatch: pytest.MonkeyPatch, scale: float, side: int
) -> None:
    theme.set(scale=scale)
    ring = GaitRing(theme)
    ring.setFixedSize(theme.px(side), theme.px(side))
    known: Phases = dict.fromkeys(Leg, LegPhase(100.0, "terminal stance"))
    for word, below, phases in (
        ("Walking", "120 steps/min", known),
        ("Activity not known", "", dict.fromkeys(Leg)),
    ):
        ring.show_phases(phases, phases, word, below, live=True)
        with_words = _pixels(ring)
        with monkeypatch.context() as patched:
            patched.setattr(GaitRing, "_draw_words", lambda *_: None)
            changed = (with_words != _pixels(ring)).any(axis=2)
        rings, band, _ = ring._places()
        free = rings[Leg.RIGHT].width() / 2 - band / 2
        down, across = np.nonzero(changed)
        middle = rings[Leg.RIGHT].center()
        assert len(down), word
        assert np.hypot(across + 0.5 - middle.x(), down + 0.5 - middle.y()).max() < free, word
    destroy(ring)


def _pixels(widget: QWidget) -> npt.NDArray[np.uint8]:
    """(height, width, 4)."""
    image = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return np.array(image.constBits(), np.uint8).reshape(image.height(), image.width(), 4)


@pytest.mark.parametrize("side", [150, 190, 240, 400])
def test_letters_in_the_ring_are_read_and_as_large_whatever_phase_it_is(theme: Theme, side: int) -> None:
    ring = GaitRing(theme)
    ring.setFixedSize(theme.px(side), theme.px(side))
    sizes = []
    for phase in ("pre-swing", "terminal stance"):
        known: Phases = dict.fromkeys(Leg, LegPhase(100.0, phase))
        ring.show_phases(known, known, "Walk 94 %", "120 steps/min", live=True)
        ring.grab()
        sizes.append(ring.letters)
    assert sizes[0] == sizes[1]
    assert min(sizes[0]) >= theme.text_font(0.75).pointSizeF()
    destroy(ring)


def test_letters_grow_with_the_ring_up_to_a_size(theme: Theme) -> None:
    """In a ring twice as large as the least they were as small as there."""
    ring, text = GaitRing(theme), theme.text_font().pointSizeF()
    walks: Phases = dict.fromkeys(Leg, LegPhase(27.0, "mid-stance"))
    nothing: Phases = dict.fromkeys(Leg)
    for known, word in ((walks, "Walk"), (nothing, "Activity not known")):
        sizes = {}
        for side in (90, 130, 180):
            ring.setFixedSize(theme.px(side), theme.px(side))
            ring.show_phases(known, known, word, "", live=True)
            ring.grab()
            sizes[side] = min(ring.letters) / text
        assert sizes[90] < sizes[130] <= sizes[180], word
        assert 1.1 < sizes[180] < 1.4, word
    destroy(ring)
