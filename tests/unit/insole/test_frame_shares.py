"""A share of bad frames is told from a threshold on; where some are missing, what comes is believed."""

import pytest

from drivers.frame_shares import WINDOW_S, FrameShare
from drivers.insole.device import Insole
from drivers.insole.settings import InsoleSettings
from drivers.samples import ComponentState
from tests.unit.insole.encode import Sender

SECOND_NS = 1_000_000_000


def test_a_share_is_told_as_long_as_it_is_large() -> None:
    share = FrameShare(0.1, "of its frames are bad", "check them")
    bad = whole = now_ns = 0

    def live(part: int) -> str:
        nonlocal bad, whole, now_ns
        share.update(now_ns, bad, whole)
        bad, whole, now_ns = bad + part, whole + 100, now_ns + round(WINDOW_S * SECOND_NS)
        share.update(now_ns, bad, whole)
        return "" if share.finding is None else share.finding.text(now_ns)

    assert live(9) == ""
    assert live(10) == "10 % of its frames are bad (for 0 s): check them"
    assert live(6) == "6 % of its frames are bad (for 5 s): check them"
    assert live(4) == ""


@pytest.mark.parametrize(("every", "words"), [(5, "20 % of its frames are missing (for"), (100, None)])
def test_missing_frames_are_told_and_what_came_is_believed(every: int, words: str | None) -> None:
    insole, sender = Insole("left_insole", InsoleSettings(port="-")), Sender()
    now_ns = SECOND_NS
    for number in range(2400):
        now_ns += SECOND_NS // 200
        frame = sender.frame([200 + number % 50] * 16)
        if number % every:
            insole.received(insole.line.parser.feed(frame), now_ns)
    quality = insole.quality(now_ns)
    assert quality.state is ComponentState.OK
    if words is None:
        assert (quality.problem, quality.findings) == (None, ())
    else:
        assert words in str(quality.problem)
        assert quality.findings[0].check.startswith("check its cable")
