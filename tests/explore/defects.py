"""The defects that were proved once, each with how it would be put back and by which invariant it is found.

`parts` are the texts that put it back (`defects.toml`); without any it is looked for in the code as it is.
`scenes` and `events` are where the search looks, so that a defect takes seconds and not hours; nothing says
in which order.
"""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

from tests.explore.mutating import Part


@dataclass(frozen=True, slots=True)
class Defect:
    """One defect: in words, what shows it, and where to look."""

    words: str
    shows: tuple[str, ...]  # invariants, one of which must be violated
    scenes: tuple[str, ...]
    events: tuple[str, ...]
    parts: tuple[Part, ...] = ()
    text: str = ""  # a regular expression of what the violation must say
    depth: int = 2


_DEFECTS: dict[str, Defect] = {
    "stop-that-enables": Defect(
        "a quick stop enables the drive (never was there: it shows that the explorer looks)",
        ("nobody_enables",),
        ("resting",),
        ("ben stops",),
        parts=(Part("drivers.joint.commands", "QUICK_STOP = 0x0002", "QUICK_STOP = 0x000F"),),
        depth=1,
    ),
    "trip-lost-in-reset": Defect(
        "a guard trip during a reset is lost: the hold ends, the rule stays tripped",
        ("a_trip_is_held",),
        ("held",),
        ("ada resets", "knee is pushed", "knee is bumped", "knee is let go"),
    ),
    "late-answers-believed": Defect(
        "late SDO answers are taken for the roll-back's check read: “unchanged”, and it is not",
        ("an_answer_to_a_write_is_true",),
        ("walking",),
        ("gait is late", "write step", "write both", "all is well"),
        text="'unchanged'",
    ),
    "late-answers-end-a-trial": Defect(
        "late SDO answers are taken for the check read of a trial's end: its entry goes, its value stays",
        ("an_undo_entry_is_dropped_for_a_reason",),
        ("trial",),
        ("gait is late", "right is late", "try step", "revert", "all is well"),
    ),
    "reset-without-controller": Defect(
        "a reset ends the hold though a controller cannot be reached",
        ("a_hold_ends_knowing",),
        ("held",),
        ("ada resets", "gait dies", "gait hears no SDO", "ben stops"),
        text="controller",
    ),
    "controller-asked-once": Defect(
        "while a stop is held, controllers are asked once instead of again and again",
        ("what_is_held_stands",),
        ("restarted", "held"),
        ("gait is started", "right is late", "left dies", "right dies", "bus right is blocked"),
        text="controller",
        depth=3,
    ),
    "boot-interrupted": Defect(
        "each quick stop of an unseen drive interrupts its boot, which begins anew: it is lost for good",
        ("who_answers_is_there",),
        ("held", "dark"),
        ("right is slow", "left is slow", "gateway is killed", "right boots", "all is well"),
    ),
    "reads-interrupted": Defect(
        "a trial's end waits behind a read that a held stop interrupts again and again",
        ("a_trial_ends",),
        ("trial",),
        ("right dies", "gait hears no SDO", "knee is bumped", "ben stops"),
        text="ankle|gait",
    ),
    "controller-is-a-parameter": Defect(
        "a roll-back, the end of a trial or a plain write restarts the controller under a held stop",
        ("nothing_forbidden_is_written",),
        ("walking",),
        ("try run", "ben stops", "knee is pushed", "write run"),
        text="gait.run = 1",
    ),
    "trial-without-position": Defect(
        "a trial is not taken back while SDO works but the position is missing",
        ("a_trial_ends",),
        ("resting",),
        ("try torque", "left sends no TPDO"),
        text="knee.max_torque",
    ),
    "revert-past-max-step": Defect(
        "a revert is larger than max_step allows",
        ("nothing_forbidden_is_written",),
        ("trial",),
        ("try step", "revert", "ada leads"),
        text="counts at once",
    ),
    "revert-past-live": Defect(
        "a parameter that is not live is taken back while its drive is enabled",
        ("nothing_forbidden_is_written",),
        ("resting",),
        ("try torque", "gait is started", "somebody enables knee", "revert"),
        text="not live",
    ),
    "write-after-slow-disk": Defect(
        "drive states are checked once, before the fsync: a slow disk later the drive may be enabled",
        ("nothing_forbidden_is_written",),
        ("resting",),
        ("disk is slow", "write torque", "gait is started", "somebody enables knee"),
        text="not live",
        depth=3,
    ),
    "blocked-bus-delays-others": Defect(
        "one blocked bus delays the controlwords on the others",
        ("a_stop_is_on_the_bus",),
        ("walking",),
        ("bus left is blocked", "bus right is blocked", "ada stops", "ben stops"),
    ),
    "blocked-bus-delays-guard": Defect(
        "one blocked bus delays the hold of a guard's stop",
        ("a_trip_is_held",),
        ("walking",),
        ("bus left is blocked", "bus right is blocked", "knee is pushed", "knee is bumped"),
    ),
    "two-axes-one-deadline": Defect(
        "of a two-axis drive one axis ignores the stop, and the other that held at once is made limp",
        ("nobody_enables", "what_a_stop_says_is_true"),
        ("walking",),
        ("hip ignores stops", "ada stops", "ben stops"),
    ),
    "second-axis-behind-confirmation": Defect(
        "as master, a second axis is asked only when the first has confirmed",
        ("a_stop_is_on_the_bus",),
        ("bench",),
        ("ada stops",),
        text="ankle",
        depth=1,
    ),
    "hold-ends-on-stale-knowledge": Defect(
        "the hold ends on stale knowledge: a drive was enabled again while another was led down",
        ("a_hold_ends_knowing",),
        ("held",),
        ("ada resets", "somebody enables knee", "somebody enables ankle", "gait is started"),
        text="last said|at rest",
    ),
    "trip-while-held-interrupts-nothing": Defect(
        "a trip under a held stop does not end the write that is under way",
        ("nothing_forbidden_is_written",),
        ("held",),
        ("write torque", "try step", "write both", "knee is pushed", "knee is bumped"),
        text="nobody has asked",
    ),
    "damaged-undo-stops-control": Defect(
        "a damaged undo file that cannot be renamed keeps control, and so the stop, from starting",
        ("nothing_fails_unexpectedly", "a_stop_is_accepted"),
        ("trial",),
        ("undo is damaged for good", "gateway is killed", "ada stops"),
    ),
    "refused-value-in-rpdo": Defect(
        "a value that the drive has refused is carried by the next stop's RPDO",
        ("values_are_wanted", "nothing_forbidden_is_written"),
        ("bench",),
        ("left refuses a write", "write torque", "ada stops"),
        depth=3,
    ),
    "bus-thread-ends": Defect(
        "a bus thread ends by an exception of its transport that nobody expected",
        ("nothing_fails_unexpectedly",),
        ("walking",),
        ("bus left breaks",),
        text="thread can left",
        depth=1,
    ),
    "half-closed-streams": Defect(
        "a client that has ended and streams is taken for half-closed: its trial stays in force",
        ("a_trial_ends",),
        ("lasting",),
        ("ada says no more", "ada dies"),
        depth=1,
    ),
    "no-place-for-a-stop": Defect(
        "when all places are taken by silent connections, a stop is refused",
        ("a_stop_is_on_the_bus", "a_stop_is_answered"),
        ("resting",),
        ("a crowd comes", "ben stops"),
    ),
    "stop-behind-a-full-queue": Defect(
        "a stop behind a full queue of its own client is not read",
        ("a_stop_is_on_the_bus",),
        ("resting",),
        ("gait dies", "gait is late", "ada floods", "ada stops"),
        depth=3,
    ),
    "stop-refused-for-its-form": Defect(
        "a stop is refused for its form",
        ("a_stop_is_on_the_bus",),
        ("resting",),
        ("ben stops oddly",),
        depth=1,
    ),
}


def _with_parts() -> dict[str, Defect]:
    told = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    parts = {name: tuple(Part(**part) for part in some) for name, some in told.items()}
    return {name: replace(one, parts=one.parts + parts.get(name, ())) for name, one in _DEFECTS.items()}


DEFECTS = _with_parts()
