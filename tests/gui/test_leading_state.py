"""The strip of alarms leads with the state that the robot's card has."""

import time

import pytest

from server_gui.core.alarms.texts import Kind
from tests.gui.fakes import Around, Bench
from tests.gui.faulty import settle
from tests.support.desk import JOINTS, looked, telemetry


def reset(bench: Bench, state: float, quality: str = "ok") -> None:
    """A stop was just reset, with every drive in this state, and the left knee in this quality."""
    received_ns = time.monotonic_ns()
    columns: dict[str, list[float | None]] = {f"{joint}.state": [state] for joint in JOINTS}
    bench.station.take(
        [telemetry([received_ns], columns, received_ns), looked(state=quality, problem="late")]
    )
    bench.station.stopping.held = True
    bench.station.stopping.was_reset(held=False)
    bench.look_again([looked(state=quality, problem="late")])


def test_after_a_reset_how_to_go_on_is_said_with_a_warning_that_is_not_its_cause_beside_it(
    around: Around, bench: Bench
) -> None:
    reset(bench, 6.0, "stale")
    settle(around, bench)
    assert around.alarms.told[0][1].alarm.kind is Kind.RESET
    assert around.alarms._icon.mark == bench.station.mark
    said = around.alarms.accessibleDescription()
    assert said.startswith(
        "stop reset: nothing moves until the drives are enabled · also component stale: left knee: late; "
    )
    assert "to go on: enable the drives" in said


@pytest.mark.parametrize(("state", "is_off"), [(5.0, False), (6.0, True)])
def test_without_a_warning_the_strip_is_as_bad_as_the_drives_are(
    around: Around, bench: Bench, monkeypatch: pytest.MonkeyPatch, state: float, is_off: bool
) -> None:
    monkeypatch.setattr(type(bench.station.robot), "has_rate", lambda *_: True)
    monkeypatch.setattr(type(bench.station.robot), "is_slow", lambda *_: False)
    reset(bench, state)
    settle(around, bench)
    assert bench.station.mark.colour == ("dim" if is_off else "warn")
    assert around.alarms._icon.mark == bench.station.mark
    said = around.alarms.accessibleDescription()
    assert said.startswith("stop reset: ")
    assert ("every drive is off" in said) is is_off
    assert ("all 6 drives in quick stop active" in said) is not is_off
    around.alarms.acknowledge(around.alarms.told[0])
    settle(around, bench)
    assert around.alarms._icon.mark == bench.station.mark, "with every drive off not all is well"
    assert "all ok" not in around.alarms.accessibleDescription()
