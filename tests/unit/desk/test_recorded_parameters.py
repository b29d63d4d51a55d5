"""Parameters during a recording: of its start, as its journal tells since, and unknown where it does not."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from server_gui.core.archive.recorded_parameters import RecordedParameters
from server_gui.core.cloud.tape import Tape

KNEE, HIP = "left_knee.max_torque", "left_hip.max_torque"


def opened(
    *events: dict[str, str], setup: dict[str, str] | None = None, start: object = 80
) -> RecordedParameters:
    session = SimpleNamespace(parameters={KNEE: start, HIP: None}, setup=setup or {})
    made = RecordedParameters()
    made.open(cast("Tape", SimpleNamespace(session=session, events=events)))
    return made


def entry(what: str, at_ns: int, **more: Any) -> dict[str, Any]:
    return {"what": what, "utc_ns": at_ns, "write": 7} | more


def knee(parameters: RecordedParameters, at_ns: int) -> float | None:
    held = parameters.at(at_ns).get(KNEE)
    return None if held is None else cast("float | None", held.value)


def test_object_and_unit_are_those_of_the_recording_and_what_it_does_not_tell_is_not_there() -> None:
    made = opened(setup={f"object/{KNEE}": "0x6072:0 N·m"})
    (info,) = made.described
    assert (info.name, info.component, info.object, info.unit) == (KNEE, "left_knee", "0x6072:0", "N·m")
    assert {name: (one.value, one.unit) for name, one in made.at(0).items()} == {KNEE: (80.0, "N·m")}
    assert opened().described == [], "an older recording says of no parameter what it is"


def test_a_write_counts_from_when_it_was_done_and_a_trial_until_it_was_taken_back() -> None:
    made = opened()
    asked = {"before": {KNEE: 80}, "after": {KNEE: 40}}
    made.tell(
        [
            entry("write", 10, **asked),
            entry("trial begun", 12, after={KNEE: 40}),
            entry("taken back", 20),
            entry("write done", 99, after={KNEE: 1}),
        ],
        0,
        50,
    )
    assert made.told
    assert [knee(made, at_ns) for at_ns in (9, 11, 12, 19, 20, 99)] == [80, None, 40, 40, 80, 80]


@pytest.mark.parametrize(("start", "value"), [(0, 0.0), (0.0, 0.0), (-0.0, 0.0), (False, 0.0), (None, None)])
def test_zero_is_a_value_and_what_is_not_known_is_none(start: object, value: float | None) -> None:
    made = opened(start=start)
    assert knee(made, 0) == value
    made.tell(
        [
            entry("write", 10, before={KNEE: start}, after={KNEE: 40}),
            entry("trial begun", 12, after={KNEE: 40}),
            entry("taken back", 20),
            entry("write", 30, before={KNEE: start}, after={KNEE: 0}, write=0),
            entry("write done", 32, after={KNEE: 0}, write=0),
        ],
        0,
        50,
    )
    assert [knee(made, at_ns) for at_ns in (9, 12, 20, 31, 32)] == [value, 40, value, None, 0.0]
    assert KNEE in made.at(50)


@pytest.mark.parametrize("what", ["NOT TAKEN BACK yet", "ROLL-BACK FAILED", "claimed by the stop"])
def test_what_a_failed_end_has_left_is_not_known(what: str) -> None:
    made = opened()
    asked = {"before": {KNEE: 80}, "after": {KNEE: 40}}
    made.tell(
        [entry("write", 10, **asked), entry("trial begun", 12, after={KNEE: 40}), entry(what, 20)], 0, 50
    )
    assert [knee(made, at_ns) for at_ns in (12, 20)] == [40, None]


def test_without_a_whole_journal_only_the_start_is_known() -> None:
    assert not opened().told, "nobody has told its journal"
    broken = opened({"kind": "journal_gap"})
    broken.tell([], 0, 50)
    assert not broken.told
