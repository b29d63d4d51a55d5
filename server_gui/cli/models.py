"""`gwrms models`: which models there are, which one serves, and what served before."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import msgspec

from gateway.amounts import NONE
from gateway.cli.connect import choose
from gateway.cli.text import did_you_mean, say, say_json, table, warn
from gateway.user_name import user_name
from ml.errors import UnusableModel
from ml.registry.card import Card, age_days
from ml.registry.pointers import Pointer
from ml.registry.registry import Registry
from ml.robot.learned import Learned
from ml.robot.task import TASKS
from ml.store.private import private_files
from server_gui.cli.cloud_options import add_url, parser, url, when
from server_gui.cli.models_show import told
from server_gui.core.models.catalogue import Serving, open_registry, why_it_cannot_serve
from server_gui.core.models.changes import loss
from server_gui.core.models.names import EVERY
from server_gui.core.settings.promoters import UNSIGNED, own_line
from server_gui.core.settings.server_file import load

USAGE: Final = """usage: gwrms models COMMAND [--config server.toml] [--url URL] [--json]

  ls             list the models of the store, and those that come with GWRMS; which one serves
  show MODEL     show what it learned from, how and on whom it was judged, and if it can serve here
  promote MODEL  let it serve every robot, or with --robot one
  rollback TASK  return to the model that served before
  history TASK   show what has served, who promoted it, and why
  key            print this desk's key, which signs what it promotes
  export MODEL   export a model as ONNX, for other programs

A model's name may be abbreviated as long as it is unique. gwrms models COMMAND --help says more.
"""
PROMOTE_EPILOG: Final = """Running servers load it within seconds, without a restart. A model that cannot be
verified is refused, and the present one continues to serve. Classes that the present one knows and
this one does not are named in a warning. `gwrms train --promote` does this if a model is
judged better. With --instead-of it is refused if another model than the named one serves by then.

examples
  gwrms models promote activity-5f0c
  gwrms models promote gait_phase-77aa --robot exo-01 --why "adapted to Ada's walk\""""
ROLLBACK_EPILOG: Final = """Repeat it to go back further. Before the first model of a robot's own, the one for
all robots serves; before the first of those, the one that comes with GWRMS."""
KEY_EPILOG: Final = """Put that line into [promoters] of the server's file, on every computer that records
these robots, to let a rule stop them by the models that this desk promotes."""
NOTHING: Final = "nothing"  # that serves


def main(argv: list[str]) -> int:
    """Run `gwrms models`."""
    private_files()
    return choose(argv, COMMANDS, USAGE)


def ls(argv: list[str]) -> int:
    """Run `gwrms models ls`."""
    made = _parser("ls", "List all models, oldest first, and the robots that they serve.")
    made.add_argument("--task", choices=TASKS, help="these alone")
    arguments = made.parse_args(argv)
    registry = _registry(arguments)
    cards, damaged = registry.entries(arguments.task), registry.damaged()
    serving = Serving.of(registry, load(arguments.config).promoters)
    if arguments.json:
        say_json({"models": [_fields(card, serving) for card in cards], "damaged": damaged})
    else:
        header = ("MODEL", "RECIPE", "FROM", "MADE (UTC)", "DAYS AGO", "JUDGED", "SERVES")
        say(table(header, [_row(card, serving) for card in cards], right=(4,)))
    for problem in damaged.values():
        warn("models", problem)
    return 1 if damaged else 0


def _row(card: Card, serving: Serving) -> tuple[str, ...]:
    shipped = card.id in serving.shipped
    judged = next((f"{name} {value:.3g}" for name, value in card.metrics.figures.items()), NONE)
    return (
        card.id,
        card.recipe,
        f"shipped, {card.source.value}" if shipped else card.source.value,
        when(card.made),
        f"{age_days(card):.0f}",
        judged,
        serving.told(card.id) or NONE,
    )


def _fields(card: Card, serving: Serving) -> dict[str, Any]:
    fields: dict[str, Any] = msgspec.to_builtins(card)
    more = {"shipped": card.id in serving.shipped, "serves": serving.whom.get(card.id, [])}
    more["signed"] = serving.signed.get(card.id, [])
    return fields | more | {"age_days": round(age_days(card), 2)}


def show(argv: list[str]) -> int:
    """Run `gwrms models show`."""
    made = _parser("show", "Show a model's card. Exit status 1: it cannot serve here.")
    made.add_argument("model", metavar="MODEL", help="its name, which may be abbreviated")
    arguments = made.parse_args(argv)
    registry = _registry(arguments)
    card = registry.card(_named(registry, arguments.model))
    problem = why_it_cannot_serve(registry, card.id)
    serving = Serving.of(registry, load(arguments.config).promoters)
    if arguments.json:
        say_json(_fields(card, serving) | {"problem": problem})
    else:
        say("\n".join(told(card, serving.told(card.id), problem, shipped=card.id in serving.shipped)))
    return 1 if problem else 0


def promote(argv: list[str]) -> int:
    """Run `gwrms models promote`."""
    made = _parser("promote", "Let a model serve.", PROMOTE_EPILOG)
    made.add_argument("model", metavar="MODEL", help="its name, which may be abbreviated")
    made.add_argument(
        "--instead-of",
        metavar="MODEL",
        help=f"promote only while this one serves; {NOTHING}: while none does",
    )
    _add_who(made, "this robot alone")
    arguments = made.parse_args(argv)
    registry = _registry(arguments)
    model = _named(registry, arguments.model)
    known = load(arguments.config).robots
    if arguments.robot and arguments.robot not in known:
        close = did_you_mean(arguments.robot, known)
        warn("models", f"the server's file has no robot {arguments.robot!r}{close}")
    old = arguments.instead_of
    over = "" if old == NOTHING else old and _named(registry, old)
    if lost := loss(registry, registry.promotable(model, arguments.robot), arguments.robot):
        warn("models", lost)
    done = registry.promote(model, arguments.robot, who=arguments.who, why=arguments.why, over=over)
    return _tell(arguments, registry.card(model).task, done)


def rollback(argv: list[str]) -> int:
    """Run `gwrms models rollback`."""
    made = _parser("rollback", "Return to the model that served before.", ROLLBACK_EPILOG)
    made.add_argument("task", choices=TASKS)
    _add_who(made, "this robot's own model")
    arguments = made.parse_args(argv)
    done = _registry(arguments).rollback(
        arguments.task, arguments.robot, who=arguments.who, why=arguments.why
    )
    return _tell(arguments, arguments.task, done)


def _tell(arguments: argparse.Namespace, task: str, now: Pointer) -> int:
    if arguments.json:
        say_json({"task": task, "robot": arguments.robot, "now": now})
    else:
        whom = arguments.robot or EVERY
        gone = (
            f"no own model serves {whom} any more; what does is the one for {EVERY}, else by default"
            if arguments.robot
            else f"no promoted model serves {whom} any more; those that came with GWRMS do by default"
        )
        say(f"{task}: {now.model} serves {whom}\n" if now.model else f"{task}: {gone}\n")
    if now.model and not now.signature:
        warn(
            "models",
            f"{UNSIGNED}, so its predictions cannot stop a robot: gwrms models key makes a key, then again",
        )
    return 0


def history(argv: list[str]) -> int:
    """Run `gwrms models history`."""
    made = _parser("history", "Show which models have served, newest last.")
    made.add_argument("task", choices=TASKS)
    made.add_argument(
        "--robot", default="", metavar="NAME", help="this robot's own models (default: those for all)"
    )
    arguments = made.parse_args(argv)
    found = _registry(arguments).history(arguments.task, arguments.robot)
    if arguments.json:
        say_json(found)
    else:
        rows = [(when(now.utc), now.model or NONE, _by(now), now.why) for now in found]
        say(table(("SINCE (UTC)", "MODEL", "BY", "WHY"), rows))
    return 0


def _by(now: Pointer) -> str:
    return now.who if now.signature else f"{now.who} ({UNSIGNED})"


def key(argv: list[str]) -> int:
    """Run `gwrms models key`."""
    made = parser(
        "models key", "Print this desk's key, as a line for [promoters]; create it if necessary.", KEY_EPILOG
    )
    arguments = made.parse_args(argv)
    name, fingerprint = own_line()
    if arguments.json:
        say_json({"name": name, "key": fingerprint})
    else:
        say(f'"{name}" = "{fingerprint}"\n')
    return 0


def export(argv: list[str]) -> int:
    """Run `gwrms models export`."""
    made = _parser(
        "export", "Export a model as ONNX; both are compared on the same rows before the file is written."
    )
    made.add_argument("model", metavar="MODEL", help="its name, which may be abbreviated")
    made.add_argument(
        "--onnx", type=Path, required=True, metavar="FILE", help="output file; replaced if it exists"
    )
    arguments = made.parse_args(argv)
    registry = _registry(arguments)
    card, state = registry.load(_named(registry, arguments.model))
    from ml.registry.onnx import exported

    data = exported(Learned.restored(state))
    arguments.onnx.write_bytes(data)
    if arguments.json:
        say_json({"model": card.id, "file": str(arguments.onnx), "size_bytes": len(data)})
    else:
        say(f"{arguments.onnx}: {card.id}, {', '.join(card.classes)}\n")
    return 0


COMMANDS: Final[dict[str, Callable[[list[str]], int]]] = {
    "ls": ls,
    "show": show,
    "promote": promote,
    "rollback": rollback,
    "history": history,
    "key": key,
    "export": export,
}


def _parser(command: str, what: str, epilog: str = "") -> argparse.ArgumentParser:
    made = parser(f"models {command}", what, epilog)
    add_url(made)
    return made


def _add_who(made: argparse.ArgumentParser, whose: str) -> None:
    made.add_argument("--robot", default="", metavar="NAME", help=f"{whose} (default: that for every robot)")
    made.add_argument("--who", default=user_name(), metavar="WHO", help="author (default: %(default)s)")
    made.add_argument("--why", default="", metavar="TEXT", help="reason, kept in the history")


def _registry(arguments: argparse.Namespace) -> Registry:
    return open_registry(url(arguments), given=arguments.url is not None)


def _named(registry: Registry, text: str) -> str:
    """Return the one model whose name this is, or begins so.

    Raises:
        UnusableModel: there is none, or there are several.

    """
    known = [card.id for card in registry.entries()] + list(registry.damaged())
    found = [name for name in known if name == text] or [name for name in known if name.startswith(text)]
    if len(found) != 1:
        several = f"{text!r} is how several begin: {', '.join(found)}"
        raise UnusableModel(several if found else f"{registry.url} has no model {text!r} (gwrms models ls)")
    return found[0]
