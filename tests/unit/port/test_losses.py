"""What a sensor did not bring while its computer stood still is the computer's fault, and told once."""

import pytest

from drivers.insole.device import Insole, layout_of, line_for
from drivers.insole.settings import InsoleSettings
from drivers.parsing import Counters
from drivers.reader_stalls import ReaderStalls
from drivers.samples import ComponentState
from drivers.sensor_losses import Losses
from tests.unit.insole.encode import Sender

MS = 1_000_000
BEGAN_MS, STOOD_MS = 12_000, 900


def told(standstill: ReaderStalls, *, watched: bool, numbered: bool) -> list[str]:
    """What is said after a minute of 100 frames a second, of which those of a standstill were lost."""
    losses, frames, missed, said = Losses(standstill), 0, 0, []
    for ms in range(10, 40_000, 10):
        if BEGAN_MS <= ms < BEGAN_MS + STOOD_MS:
            missed += 1
            continue
        frames += 1
        counters = Counters(frames=frames, frames_missed=missed if numbered else 0)
        losses.update(ms * MS, counters, numbered=numbered)
        if watched and ms % 50 == 0:
            standstill.passed(ms * MS)
        said += [finding.words for finding in losses.findings]
    return said


@pytest.mark.parametrize("numbered", [True, False])
def test_frames_that_were_lost_in_a_standstill_are_not_the_sensors(numbered: bool) -> None:
    assert told(ReaderStalls(), watched=True, numbered=numbered) == []
    assert told(ReaderStalls(), watched=False, numbered=numbered), "nobody has seen that it stood still"


def test_a_silence_is_told_as_the_standstill_that_it_was() -> None:
    standstill, settings = ReaderStalls(), InsoleSettings(port="-")
    line = line_for(settings, layout_of(settings.format, None), standstill=standstill)
    line._port.opened_ns = 1  # as if it were open
    insole, sender = Insole("left_insole", settings, line), Sender()
    for ms in range(10, 1000, 10):
        standstill.passed(ms * MS)
        data = sender.frame([200] * 16)
        line._received(data, ms * MS)
        insole.received(line.parser.feed(sender.frame([201] * 16)), ms * MS)
    assert insole.quality(1000 * MS).state is ComponentState.OK
    problem = insole.quality(3000 * MS).problem or ""
    assert "this computer has stood still for 2.0 s" in problem
    assert "TX wire" not in problem
    for ms in range(3000, 7000, 50):  # the computer runs again, and the sensor is silent
        standstill.passed(ms * MS)
    assert "TX wire" in (insole.quality(7000 * MS).problem or "")
