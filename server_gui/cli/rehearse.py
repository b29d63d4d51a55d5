"""`gwrms predict --rules`: what the server's rules would have done, over recordings."""

import argparse
from collections.abc import Iterable, Sequence
from typing import Final

from gateway.cli.text import say, say_json, table
from ml.store import Store, sessions
from server_gui.core.prediction.rehearsal import Rehearsed
from server_gui.core.prediction.rehearsals import BENCHMARKS, of_sessions
from server_gui.core.prediction.replay import replay
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import ServerSettings, SettingsError

HEADER: Final = ("RULE", "ACTION", "HOURS", "BEGAN", "WITHOUT CAUSE", "AN HOUR")
NO_RULES: Final = """there is no rule to try: write one into the server's file, for example
[[rules]]
task = "falling"
label = "near_fall"
at_least = 0.9
for_ms = 60"""


def rehearse(settings: ServerSettings, arguments: argparse.Namespace) -> int:
    """Print the outcome of each rule on recordings."""
    if not settings.rules:
        raise SettingsError(NO_RULES)
    if arguments.benchmark:
        about = BENCHMARKS[arguments.benchmark].about
        found = BENCHMARKS[arguments.benchmark].rehearse(settings.rules, arguments.data, arguments.falls)
    else:
        about, found = _over_sessions(settings, arguments)
    if arguments.json:
        say_json([_fields(one) for one in found])
    else:
        say("\n".join(_told(about, found, settings.rules)))
    return 0


def _over_sessions(settings: ServerSettings, arguments: argparse.Namespace) -> tuple[str, list[Rehearsed]]:
    store = Store.existing(settings.store.url)
    replayed = []
    for name in arguments.session:
        session = sessions.find(store, name)
        replayed.append((session.robot, replay(store, session, settings.prediction, arguments.model)))
    return f"{len(replayed)} sessions", of_sessions(settings.rules, settings.prediction, replayed)


def _told(about: str, found: Sequence[Rehearsed], rules: Iterable[RuleSettings]) -> Iterable[str]:
    yield f"over {about}:"
    if found:
        yield table(HEADER, map(_row, found), range(2, len(HEADER))).rstrip()
    shown = [one.rule for one in found]
    yield from (f"{rule.name}: these recordings show nothing of it" for rule in rules if rule not in shown)
    if any(not one.known and one.began for one in found):
        yield "Nobody has labelled these sessions (gwrms label): every time counts as without cause."
    stops = sum(one.false_per_hour for one in found if one.rule.action is Action.STOP)
    yield f"False stops: {stops:.2f} an hour.\n"


def _row(one: Rehearsed) -> tuple[str, ...]:
    counts = (f"{one.hours:.2f}", str(one.began), str(one.false), f"{one.false_per_hour:.2f}")
    return one.rule.name, one.rule.action.value, *counts


def _fields(one: Rehearsed) -> dict[str, object]:
    return {
        "rule": one.rule,
        "hours": one.hours,
        "began": one.began,
        "without_cause": one.false,
        "per_hour": one.false_per_hour,
        "labelled": one.known,
    }
