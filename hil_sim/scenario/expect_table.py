"""An `[[expect]]` of a scenario file becomes expectations."""

import fnmatch
import math
from collections.abc import Callable, Collection, Iterator, Mapping

from hil_sim.exoskeleton import CONTROLLER, JOINTS, SENSORS
from hil_sim.scenario.expectation import Condition, Expectation, Seen, Timing, Track, When
from hil_sim.scenario.table import Table, unknown
from hil_sim.scenario.truth import names, words

TIMINGS = {when.value: when for when in When}
# subject → the conditions that may be asked of it
SUBJECTS = {
    "component": ("state", "problem"),
    "channel": ("min", "max", "is", "missing"),
    "truth": ("min", "max", "is"),
    "answer": ("is", "says"),
    "rule": ("tripped", "reason", "stop"),
}
# conditions that look at something else than their subject does
_TRACKS = {"problem": Track.PROBLEM, "reason": Track.REASON, "stop": Track.STOP}


TRIPPED = "tripped"  # of a guard's rule
STATES = ("ok", "stale", "lost", "fault")  # of a component, as gateways say them
COMPONENTS = (*JOINTS, CONTROLLER, *SENSORS)  # of the robot's own file


def read(table: Table, rules: Collection[str] = ()) -> list[Expectation]:
    """Return the expectations of one table, where the scenario's guard has these rules; raises `Unusable`."""
    subject = table.one_of(SUBJECTS)
    table.only({subject, *SUBJECTS[subject], *TIMINGS})
    glob, timing = table.text(subject), _timing(table)
    _check_name(table, subject, glob, rules)
    if subject == "truth":
        _check_truth(table, glob)
    if table.values.get("missing") is True and ("min" in table or "max" in table):
        table.complain("missing", "what is missing has no value: leave min and max out")
    found = [
        Expectation(_TRACKS.get(key, Track(subject)), glob, condition, timing)
        for key, condition in _conditions(table, SUBJECTS[subject])
    ]
    if not found:
        raise table.unusable(f"say what is expected of {glob} with {', '.join(SUBJECTS[subject])}")
    return found


def _check_name(table: Table, subject: str, glob: str, rules: Collection[str]) -> None:
    """Warn of a name that the robot does not have; a robot.toml of one's own may have others."""
    known: Collection[str] = {"truth": names(), "rule": sorted(rules)}.get(subject, COMPONENTS)
    asked = glob.partition(".")[0] if subject == "channel" else glob
    if subject == "answer" or asked in ("resource", "guard") or fnmatch.filter(known, asked):
        return
    table.warn(subject, unknown(asked, known) if known else "the scenario has no [guard.rule.NAME]")


def _check_truth(table: Table, glob: str) -> None:
    """Refuse the impossible: an unknown word, or a limit for a text."""
    fitting = fnmatch.filter(names(), glob)
    allowed = {word for name in fitting for word in words(name)}
    if fitting and "is" in table and table.values["is"] not in allowed:
        said = unknown(str(table.values["is"]), sorted(allowed)) if allowed else "it is a number: min, max"
        table.complain("is", said)
    for key in ("min", "max"):
        if allowed and key in table:
            table.complain(key, f"{glob} is in words: is = {sorted(allowed)[0]!r}")


def _timing(table: Table) -> Timing:
    key = table.one_of(TIMINGS)
    when = TIMINGS[key]
    begin_s, end_s = (table.seconds(key), math.inf) if when is When.AT else table.window(key)
    return Timing(when, begin_s, end_s)


def _conditions(table: Table, keys: tuple[str, ...]) -> Iterator[tuple[str, Condition]]:
    """Yield the conditions of a table; `min` and `max` are one condition."""
    given = [key for key in keys if key in table and not (key == "max" and "min" in table)]
    for key in given:
        yield key, _CONDITIONS[key](table, key)


def _is(table: Table, key: str) -> Condition:
    wanted = table.text(key)
    return Condition(f"is {wanted!r}", lambda seen: seen == wanted)


def _state(table: Table, key: str) -> Condition:
    table.choice(key, STATES, STATES[0])
    return _is(table, key)


def _contains(table: Table, key: str) -> Condition:
    wanted = table.text(key)
    if not wanted:
        return Condition("is nothing", lambda seen: seen == "")
    return Condition(f"says {wanted!r}", lambda seen: isinstance(seen, str) and wanted in seen)


def _in_range(table: Table, _key: str) -> Condition:
    low = table.number("min") if "min" in table else -math.inf
    high = table.number("max") if "max" in table else math.inf
    if low > high:
        table.complain("min", f"{low:g} is above max {high:g}")
    words = [f"at least {low:g}"] * ("min" in table) + [f"at most {high:g}"] * ("max" in table)

    def holds(seen: Seen) -> bool:
        return isinstance(seen, float) and low <= seen <= high

    return Condition(" and ".join(words), holds)


def _missing(table: Table, key: str) -> Condition:
    if table.flag(key):
        return Condition("is missing", lambda seen: seen is None)
    return Condition("has a value", lambda seen: seen is not None)


def _tripped(table: Table, key: str) -> Condition:
    if table.flag(key):
        return Condition("is tripped", lambda seen: seen == TRIPPED)
    return Condition("is not tripped", lambda seen: seen != TRIPPED)


_CONDITIONS: Mapping[str, Callable[[Table, str], Condition]] = {
    "state": _state,
    "problem": _contains,
    "is": _is,
    "says": _contains,
    "min": _in_range,
    "max": _in_range,
    "missing": _missing,
    "tripped": _tripped,
    "reason": _contains,
    "stop": _contains,
}
