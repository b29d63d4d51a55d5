"""`gwrms predict`: what robot and wearer are doing, live or over a recording, and how far to believe it."""

import argparse
import contextlib
import dataclasses
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

from gateway.cli.arguments import seconds
from gateway.cli.text import say, say_json, warn
from gateway.client import Address, ConnectionState
from ml.registry.card import age_days
from ml.store import Store, sessions
from ml.store.private import private_files
from ml.store.sessions import Session
from server_gui.cli.cloud_options import parser
from server_gui.cli.rehearse import rehearse
from server_gui.core.prediction.adaptation import Adapting
from server_gui.core.prediction.live import Live
from server_gui.core.prediction.news import Endangered, Predicted, PredictionNews, Ruled, Serves
from server_gui.core.prediction.rehearsals import BENCHMARKS
from server_gui.core.prediction.replay import Replayed, replay
from server_gui.core.settings.prediction import DANGER
from server_gui.core.settings.server_file import ServerSettings, SettingsError, add_robots, load, name_of
from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals
from server_gui.terminal.predictions import link, replay_told, told

LOOK_S: Final = 0.25  # a look at what has come waits at most so long

Show = Callable[[Live, Sequence[PredictionNews]], None]

EPILOG: Final = """Live, robots are followed and nothing is recorded; a rule of the server's file is reported
when it holds, but stops nothing: only the program that records stops a robot (gwrms collect, or a window).

Over a session, today's models, or those that --model names, predict again. If one of them predicted live,
both predictions are compared: they are the same. If somebody has labelled the session (gwrms label),
predictions are compared with the labels. --rules shows when the rules of the server's file would have begun
to hold, and how often an hour without cause: look at that before you let a rule stop a robot.

examples
  gwrms predict --robot exo-01
  gwrms predict --robot 127.0.0.1:7420 --json
  gwrms predict --session 20261121T1530 --rules
  gwrms predict --rules --benchmark sisfall-prefall --data falls.npz

exit status
  0 predicted (live: until Ctrl-C or --seconds); 1 nothing was or can be predicted; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms predict`."""
    private_files()
    made = _parser()
    arguments = made.parse_args(argv)
    if not (arguments.robot or arguments.session or arguments.benchmark):
        made.error("say --robot NAME, or --session SESSION")
    if bool(arguments.benchmark) != bool(arguments.data) or (arguments.benchmark and not arguments.rules):
        made.error("--rules, --benchmark NAME and --data FILE.npz go together")
    if arguments.rules and not (arguments.session or arguments.benchmark):
        made.error("--rules are tried over recordings: say --session SESSION, or --benchmark NAME")
    settings = _settings(arguments)
    if arguments.rules:
        return rehearse(settings, arguments)
    if arguments.session:
        return _sessions(settings, arguments)
    return _live(settings, _addresses(settings, arguments.robot), arguments)


def _settings(arguments: argparse.Namespace) -> ServerSettings:
    """Return the server's file, with another store where one is named; here prediction is always on."""
    settings = load(arguments.config)
    replace = msgspec.structs.replace
    store = replace(settings.store, url=arguments.url) if arguments.url else settings.store
    return replace(settings, store=store, prediction=replace(settings.prediction, enabled=True))


# --- live


def _addresses(settings: ServerSettings, asked: list[str]) -> dict[str, Address]:
    """Return them by name in the server's file, else by address."""
    names = [_name(settings, text) for text in asked]
    given = {
        name: text.removeprefix(f"{name}=")
        for name, text in zip(names, asked, strict=True)
        if text not in settings.robots
    }
    known = add_robots(settings, given).robots
    return {name: known[name].where for name in names}


def _name(settings: ServerSettings, text: str) -> str:
    """Return the name of a robot in the server's file, or given with its address."""
    name, equals, _ = text.partition("=")
    if equals or text in settings.robots:
        return name
    if ":" in text:
        return name_of(text)
    known = ", ".join(settings.robots) or "none"
    if not text:
        raise SettingsError(
            f"--robot is empty: say HOST:PORT, or a robot of the server's file, which names {known}"
        )
    raise SettingsError(
        f"{text!r} is no robot of the server's file, which names {known}; say where it is: {text}=HOST:PORT"
    )


def _live(settings: ServerSettings, robots: Mapping[str, Address], arguments: argparse.Namespace) -> int:
    linked = _Linked()
    until_s = math.inf if arguments.seconds is None else time.monotonic() + arguments.seconds
    predicted = False
    with (
        ShutdownSignals() as ending,
        contextlib.suppress(ShutdownRequested),
        Live(settings, robots) as live,
        _shown(arguments) as show,
    ):
        while time.monotonic() < until_s:
            ending.check()
            news = live.look(LOOK_S)
            predicted |= any(isinstance(one, Predicted) for one in news)
            show(live, news)
            if arguments.json or not sys.stdout.isatty():  # the picture says it itself
                linked(live)
    if not predicted:
        warn("predict", "nothing was predicted: a model takes some seconds of the channels that it knows")
    return 0 if predicted else 1


class _Linked:
    """Say on stderr how each robot is reached, whenever that changes."""

    def __init__(self) -> None:
        self._said: dict[str, str] = {}

    def __call__(self, live: Live) -> None:
        for name, watched in live.robots.items():
            state = watched.robot.link.state
            if state is ConnectionState.CONNECTING and name in self._said:
                continue  # it tries again, which ends in another word or in the same
            told_now = "connected" if state is ConnectionState.CONNECTED else link(watched)
            if self._said.get(name) != told_now:
                self._said[name] = told_now
                warn("predict", f"{name}: {told_now}")


@contextlib.contextmanager
def _shown(arguments: argparse.Namespace) -> Iterator[Show]:
    """Provide the output: JSON lines, a picture that is drawn anew, or lines of what is new."""
    if arguments.json:
        yield _show_json
    elif sys.stdout.isatty():
        from rich.live import Live as Picture
        from rich.text import Text

        with Picture(refresh_per_second=1 / LOOK_S) as picture:
            yield lambda live, _: picture.update(Text(_page(live)))
    else:
        said: dict[tuple[str, str], str] = {}
        yield lambda _, news: _show_new(news, said)


def _page(live: Live) -> str:
    return "\n".join(told(name, watched) for name, watched in live.robots.items())


def _show_json(_live: Live, news: Sequence[PredictionNews]) -> None:
    for one in news:
        say_json(fields(one))


def _show_new(news: Sequence[PredictionNews], said: dict[tuple[str, str], str]) -> None:
    """Print a line for each change."""
    for one in news:
        match one:
            case Predicted(prediction=prediction):
                key = (one.robot, prediction.task)
                if said.get(key) != prediction.label:
                    said[key] = prediction.label
                    said_now = f"{prediction.label} {prediction.probability:.2f}"
                    say(f"{one.robot} {prediction.task}: {said_now}, {prediction.model}\n")
            case Endangered():
                key = (one.robot, DANGER)
                if said.get(key) != one.verdict.level.word:
                    said[key] = one.verdict.level.word
                    say(f"{one.robot} danger: {one.text}\n")
            case Ruled():
                say(f"{one.robot} {one.text}\n")
            case Adapting():
                pass  # nobody is named here
            case Serves():
                for why in one.why.values():
                    say(f"{one.robot} {why}\n")


def fields(one: PredictionNews) -> dict[str, Any]:
    """Return the prediction's fields, for machines."""
    match one:
        case Predicted():
            trust = {"trust": one.trust.level.value, "drifted": one.trust.drifted}
            made = {
                "made": one.card.made,
                "source": one.card.source,
                "age_days": round(age_days(one.card), 2),
            }
            took = {"utc_ns": one.utc_ns, "took_s": None if one.took_ns is None else one.took_ns / 1e9}
            quality = {"quality": one.quality}
            return {"robot": one.robot} | dataclasses.asdict(one.prediction) | trust | made | took | quality
        case Endangered(verdict=verdict):
            levels = {"level": verdict.level.word, "number": verdict.number, "why": verdict.why}
            silent = {"speaking": verdict.speaking, "silent": verdict.silent}
            return {"robot": one.robot, "danger": levels | silent, "utc_ns": one.utc_ns}
        case Ruled():
            return {"robot": one.robot, "rule": one.rule, "holds": one.began, "text": one.text}
        case Adapting():
            return {"robot": one.robot, "adapting": one.state.value}
        case Serves():
            models = {task: card.id for task, card in one.models.items()}
            return {"robot": one.robot, "models": models, "why": one.why}


# --- over a session


def _sessions(settings: ServerSettings, arguments: argparse.Namespace) -> int:
    store = Store.existing(settings.store.url)
    for name in arguments.session:
        session = sessions.find(store, name)
        found = replay(store, session, settings.prediction, arguments.model)
        if arguments.json:
            _say_replayed(session, found)
            continue
        say(f"session {session.session} of {session.robot}, {session.length.total_seconds():.0f} s\n\n")
        for one in found:
            say(replay_told(one) + "\n")
    return 0


def _say_replayed(session: Session, found: Sequence[Replayed]) -> None:
    """Print a line per decision, then one per task."""
    whose = {"robot": session.robot, "session": session.session}
    for one in found:
        for prediction, utc_ns in zip(one.predictions, one.utc_ns, strict=True):
            truth = {"truth": one.truth[prediction.stamp_ns]} if prediction.stamp_ns in one.truth else {}
            say_json(whose | dataclasses.asdict(prediction) | {"utc_ns": utc_ns} | truth)
    for one in found:
        about = {"task": one.model.card.task, "model": one.model.card.id, "decisions": len(one.predictions)}
        trust = {"trust": one.trust.level.value, "drifted": one.trust.drifted}
        say_json(
            whose | about | {"live": one.live, "quality": one.quality, "flattered": one.flattered} | trust
        )


def _parser() -> argparse.ArgumentParser:
    made = parser(
        "predict", "Predict the activity of robot and wearer, with the trust in the models.", EPILOG
    )
    made.add_argument(
        "--robot",
        action="append",
        default=[],
        metavar="NAME|[NAME=]HOST:PORT",
        help="live: a robot of the server's file, or its address; repeatable",
    )
    made.add_argument("--seconds", type=seconds, metavar="N", help="live: duration")
    made.add_argument(
        "--session",
        action="append",
        default=[],
        metavar="SESSION",
        help="over a recording: its name, which may be abbreviated; repeatable",
    )
    made.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="ID",
        help="over a recording: use this model instead of the serving one; repeatable",
    )
    made.add_argument(
        "--rules",
        action="store_true",
        help="over recordings: rehearse the rules of the server's file",
    )
    made.add_argument(
        "--benchmark", choices=BENCHMARKS, metavar="NAME", help=f"with --rules: {', '.join(BENCHMARKS)}"
    )
    made.add_argument("--data", type=Path, metavar="FILE.npz", help="the benchmark's recordings")
    made.add_argument(
        "--falls", type=Path, metavar="FILE.npz", help="for ipol-falls: recordings of falls to learn from"
    )
    made.add_argument(
        "--url", metavar="URL", help="the store of models and recordings (default: of the server's file)"
    )
    return made
