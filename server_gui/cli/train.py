"""`gwrms train`: a model from recorded sessions and their labels, judged before it may serve."""

import argparse
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Final

from gateway.amounts import NONE
from gateway.cli.text import say, say_json, table, warn
from gateway.user_name import user_name
from ml.errors import Overtaken
from ml.progress import Tell, untold
from ml.registry.card import Metrics
from ml.registry.registry import Registry
from ml.robot.task import TASKS
from ml.store.private import private_files
from ml.training.judging import Judged
from ml.training.training_sessions import Wish
from server_gui.cli.cloud_options import add_url, parser, url
from server_gui.cli.models import NOTHING
from server_gui.core.models.training import Progress
from server_gui.core.settings.promoters import desk_signature

if TYPE_CHECKING:
    from ml.training.training import Trained

FIGURES: Final = (
    "macro_f1", "accuracy", "rmse_percent", "abstained", "stepping_where_none_steps",
    "covered", "worst_subject_covered", "promised_covered", "promised_wearers",
)  # fmt: skip
EPILOG: Final = """The model learns from every session with labels (gwrms label). A quarter of the wearers,
chosen by a hash of their names, or those that --held-out names, are held out to judge it. Name a session's
wearer with gwrms label SESSION --wearer NAME; spelling does not matter: P01, p01 and P-1 are one. If no
wearer is named, each session counts as a separate wearer; if some are, sessions without a name judge nothing.
Sessions of the regression set are never learned from, and judge every model.

The model is published (gwrms models ls). With --promote it also serves, if it is better on the held-out
people than the model that serves now, nowhere much worse, and if that model still serves when training ends.
If no model serves robots with these sensors, it serves if it is better than a constant prediction.
gwrms models rollback takes that back.

examples
  gwrms train activity
  gwrms train activity --held-out P03 --held-out P07 --promote
  gwrms train activity --pseudo-labels 0.95       # also from sure predictions of the serving model
  gwrms train gait_phase --robot exo-01 --session 20261121T1530 --adapt-from gait_phase-0123456789ab --promote
  gwrms train falling --cluster tcp://192.0.2.9:8786

exit status
  0 trained (with --promote: and serving); 1 it cannot be trained, or is not better; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms train`."""
    private_files()
    arguments = _parser().parse_args(argv)
    wish = Wish(
        arguments.task,
        arguments.robot,
        tuple(arguments.session),
        tuple(arguments.held_out),
        arguments.pseudo_labels,
        arguments.adapt_from,
    )
    registry = Registry(url(arguments), sign=desk_signature())
    trained = _trained(registry, wish, arguments)
    model = registry.publish(trained.learned.state(), trained.card)
    promoted, overtaken = _promoted(registry, model, trained, arguments)
    if arguments.json:
        say_json(_answer(model, trained, overtaken, promoted=promoted))
    else:
        say("\n".join(_text(model, trained, overtaken, arguments, promoted=promoted)))
    return 0 if promoted or not arguments.promote else 1


def _trained(registry: Registry, wish: Wish, arguments: argparse.Namespace) -> "Trained":
    """Train, and return the result; print a line first, for even loading the libraries takes seconds."""
    tell = _teller(arguments)
    if not arguments.json:
        warn("train", f"{wish.task}, from the sessions and labels of {registry.url}")
    from ml.training.training import train

    return train(registry, wish, arguments.cluster, tell)


def _teller(arguments: argparse.Namespace) -> Tell:
    """Return the function that reports progress: for machines in lines of JSON before the answer."""
    if arguments.json:
        if not arguments.progress:
            return untold
        return lambda what, done, total: say_json({"progress": Progress(what, done, total)})
    if arguments.progress:
        return lambda what, done, total: warn("train", f"{what}, {done} of {total}")
    return _Stages()


HEADINGS: Final = {
    "better": "better, and nowhere much worse:",
    "not better": "not to be promoted:",
    "not compared": "not compared, but able to serve:",
}


class _Stages:
    """Says what is begun, once each."""

    def __init__(self) -> None:
        self._what = ""

    def __call__(self, what: str, done: int, total: int) -> None:  # noqa: ARG002 - as a `Tell` hears them
        if what != self._what:
            self._what = what
            warn("train", what)


def _promoted(
    registry: Registry, model: str, trained: "Trained", arguments: argparse.Namespace
) -> tuple[bool, str]:
    """Promote it if it may serve. Return whether it serves now; else why another model still does."""
    if not (arguments.promote and trained.decision.may_serve):
        return False, ""
    who, why = user_name(), "; ".join(trained.decision.why)
    try:
        registry.promote(model, arguments.robot, who=who, why=why, over=trained.over)
    except Overtaken as error:
        return False, str(error)
    return True, ""


def _text(
    model: str, trained: "Trained", overtaken: str, arguments: argparse.Namespace, *, promoted: bool
) -> Iterator[str]:
    from ml.training.training import told

    card, decision = trained.card, trained.decision
    yield f"{model}: {card.recipe}, from {len(card.learned)} sessions; {card.notes}"
    yield f"compared with: {trained.serving or 'nothing, for nothing serves'}"
    yield from (f"left out: {told(each)}" for each in trained.left_out)
    yield from (f"note: {remark}" for remark in trained.remarks)
    for each in (trained.held_out, trained.regression):
        if each is not None:
            yield ""
            yield f"{each.name}, {each.decisions} decisions"
            yield table(("", "NEW", "SERVING"), _figures(each), right=(1, 2)).rstrip()
    yield ""
    yield HEADINGS[decision.verdict.value]
    yield from (f"  {why}" for why in decision.why)
    if promoted:
        yield f"it serves now, for {arguments.robot or 'every robot without a model of its own'}"
    elif overtaken:
        yield f"not promoted: {overtaken}"
    elif decision.may_serve:
        whom = f" --robot {arguments.robot}" if arguments.robot else ""
        yield f"let it serve: gwrms models promote {model}{whom} --instead-of {trained.over or NOTHING}"
    yield ""


def _figures(judged: Judged) -> Iterator[tuple[str, str, str]]:
    new, old = _flat(judged.new), {} if judged.serving is None else _flat(judged.serving)
    for name, value in new.items():
        yield name, f"{value:.4g}", f"{old[name]:.4g}" if name in old else NONE


def _flat(metrics: Metrics) -> Mapping[str, float]:
    """Return the figures that people ask for, then classes and people."""
    found: dict[str, float] = {name: metrics.figures[name] for name in FIGURES if name in metrics.figures}
    if metrics.calibration_error is not None:
        found["calibration_error"] = metrics.calibration_error
    found |= {f"F1 of {name}": score.f1 for name, score in metrics.per_class.items() if score.support}
    return found | {f"for {name}": value for name, value in metrics.per_subject.items()}


def _answer(model: str, trained: "Trained", overtaken: str, *, promoted: bool) -> dict[str, Any]:
    return {
        "model": model,
        "compared_with": trained.serving,
        "over": trained.over,
        "better": trained.decision.better,
        "verdict": trained.decision.verdict.value,
        "promoted": promoted,
        "overtaken": overtaken or None,
        "why": trained.decision.why,
        "held_out": trained.held_out,
        "regression": trained.regression,
        "left_out": {each.ask.session: each.why for each in trained.left_out},
        "remarks": trained.remarks,
    }


def _parser() -> argparse.ArgumentParser:
    made = parser("train", "Train a model on labelled sessions.", EPILOG)
    made.add_argument("task", choices=TASKS, metavar="TASK", help=f"what it predicts: {', '.join(TASKS)}")
    add_url(made)
    made.add_argument(
        "--robot", default="", metavar="NAME", help="learn from this robot only, and serve only it"
    )
    made.add_argument("--session", action="append", default=[], metavar="NAME", help="only these; repeatable")
    made.add_argument(
        "--held-out",
        action="append",
        default=[],
        metavar="WHO",
        help="wearers, or sessions, to judge by; repeatable",
    )
    made.add_argument("--promote", action="store_true", help="promote it if it is better")
    made.add_argument(
        "--pseudo-labels",
        type=_probability,
        metavar="P",
        help="learn also from what the serving model says with at least this probability, where nobody else "
        "says anything",
    )
    made.add_argument(
        "--adapt-from", default="", metavar="MODEL", help="adapt this model to a wearer's gait (gait_phase)"
    )
    made.add_argument("--progress", action="store_true", help="print the progress, a line per step")
    made.add_argument("--cluster", default="", metavar="ADDRESS", help="a Dask scheduler, for many sessions")
    return made


def _probability(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.5 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text!r} is no probability from 0.5 to 1")
    return value
