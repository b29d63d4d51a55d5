"""`gwrms label`: label the activities in a recorded session, for people and for models to learn from."""

import argparse
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import msgspec

from gateway.amounts import NONE, counted
from gateway.cli.text import did_you_mean, say, say_json, table, warn
from gateway.user_name import user_name
from ml.store import Store
from ml.store.labels import ACTIVITIES, INSTANTS, REGRESSION, WEARER, Label, utc_ns, wearer
from ml.store.private import private_files
from ml.store.sessions import Session
from server_gui.cli.cloud_options import absolute, instant_or_seconds, parser
from server_gui.core.archive.label_sources import from_events, from_table, from_truth
from server_gui.core.archive.labelling import Kept, Labelling, span
from server_gui.core.settings.server_file import ServerSettings, load

EPILOG = f"""labels that models learn from
  what a wearer does   {", ".join(ACTIVITIES[:8])},
                       {", ".join(ACTIVITIES[8:])}
  instants (no --to)   {", ".join(INSTANTS)}
Others are kept and shown as well. Times are UTC, or seconds since the session's first sample.

A label is kept once, however often it is given. A removed label no longer counts; the table still shows that
it existed. Two activities of one author at one time contradict each other and are refused; two authors may
differ.

examples
  gwrms label 20261121T1530 walk --from 10 --to 70
  gwrms label 20261121T1530 --wearer P03           # so that no model is judged by a wearer it knows
  gwrms label 20261121T1530 --regression           # a test that every model must pass
  gwrms label 20261121T1530 --file labels.csv      # with the columns from,to,label
  gwrms label 20261121T1530 --gait-events          # heel strikes and toe offs, as the sensors show them
  gwrms label 20261121T1530 --truth truth.jsonl    # of gwrms sim --truth
  gwrms label 20261121T1530 --ls
  gwrms label 20261121T1530 walk --from 10 --to 70 --remove

exit status
  0 kept, or so already; 1 refused, or not kept; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms label`."""
    private_files()
    made = _parser()
    arguments = made.parse_intermixed_args(argv)  # LABEL may follow an option
    settings = load(arguments.config)
    labelling = Labelling(settings)
    session = labelling.session(arguments.session, arguments.robot)
    if arguments.ls:
        return _ls(labelling.ls(session), as_json=arguments.json)
    labels = _wanted(made, settings, session, arguments)
    if arguments.remove:
        return _remove(labelling, labels, as_json=arguments.json)
    known = (*ACTIVITIES, *INSTANTS)
    for name in sorted({each.label for each in labels}.difference(known)):
        if wearer(name) is None and name != REGRESSION:
            close = did_you_mean(name, known) or ";"
            names = "gwrms label --help names what they learn from"
            warn("label", f"no model learns from {name!r}{close} {names}")
    return _tell(labelling.add_all(labels), as_json=arguments.json)


def _wanted(
    made: argparse.ArgumentParser, settings: ServerSettings, session: Session, arguments: argparse.Namespace
) -> Sequence[Label]:
    """Return the labels to keep or to withdraw."""
    if arguments.file is not None:
        return from_table(
            session, arguments.file, arguments.author, lambda text: absolute(session, _time(text))
        )
    if arguments.truth is not None:
        return from_truth(Store.existing(settings.store.url), session, arguments.truth)
    if arguments.gait_events:
        return from_events(Store.existing(settings.store.url), session)
    if arguments.wearer is not None or arguments.regression:
        whole = REGRESSION if arguments.regression else f"{WEARER}{arguments.wearer}"
        return [_label(session, whole, *span(session), arguments)]
    begin = absolute(session, arguments.begin)
    end = absolute(session, arguments.end) or begin
    if arguments.label is None or begin is None or end is None:
        made.error(
            "give LABEL and --from, or one of --file, --truth, --gait-events, --wearer, --regression, --ls"
        )
    return [_label(session, arguments.label, utc_ns(begin), utc_ns(end), arguments)]


def _label(session: Session, name: str, begin: int, end: int, arguments: argparse.Namespace) -> Label:
    return Label(session.robot, session.session, begin, end, name, arguments.author)


def _time(text: str) -> datetime | float:
    try:
        return instant_or_seconds(text)
    except argparse.ArgumentTypeError as error:
        raise ValueError(str(error)) from error


def _remove(labelling: Labelling, labels: Sequence[Label], *, as_json: bool) -> int:
    for each in labels:
        kept = labelling.remove(each)
    if as_json:
        say_json({"removed": len(labels), "where": kept.where.value})
    else:
        say(f"{len(labels)} taken back\n")
    return 0


def _tell(kept: Kept, *, as_json: bool) -> int:
    if as_json:
        say_json(msgspec.to_builtins(kept))
        return 0
    already = f", {kept.known} {'was' if kept.known == 1 else 'were'} so already" if kept.known else ""
    say(f"{counted(kept.new, 'label')} kept in the {kept.where.value}{already}\n")
    if kept.problem:
        warn("label", f"they wait in the spool: {kept.problem}")
    return 0


def _ls(labels: Sequence[Label], *, as_json: bool) -> int:
    if as_json:
        say_json(labels)
        return 0
    rows = [
        (each.label, _utc(each.began_utc_ns), _length(each), each.author, each.source.value)
        for each in labels
    ]
    say(table(("LABEL", "FROM (UTC)", "SECONDS", "BY", "SOURCE"), rows, right=(2,)))
    return 0


def _utc(instant_ns: int) -> str:
    return f"{datetime.fromtimestamp(instant_ns / 1e9, UTC):%Y-%m-%d %H:%M:%S.%f}"[:-3]


def _length(label: Label) -> str:
    length_ns = label.ended_utc_ns - label.began_utc_ns
    return f"{length_ns / 1e9:.3f}" if length_ns else NONE


def _parser() -> argparse.ArgumentParser:
    made = parser("label", "Label the activities in a recorded session.", EPILOG)
    made.add_argument("session", metavar="SESSION", help="its name, which may be abbreviated")
    made.add_argument("label", metavar="LABEL", nargs="?", help="the activity")
    made.add_argument("--robot", metavar="NAME", help="needed if sessions of two robots have one name")
    made.add_argument("--from", dest="begin", type=instant_or_seconds, metavar="TIME", help="beginning")
    made.add_argument("--to", dest="end", type=instant_or_seconds, metavar="TIME", help="end")
    made.add_argument("--author", default=user_name(), metavar="WHO", help="author (default: %(default)s)")
    others = made.add_mutually_exclusive_group()
    others.add_argument("--file", type=Path, metavar="FILE.csv", help="a file of labels: from,to,label")
    others.add_argument("--truth", type=Path, metavar="FILE.jsonl", help="truth of a simulated wearer")
    others.add_argument("--gait-events", action="store_true", help="label the steps found in the recording")
    others.add_argument("--wearer", metavar="NAME", help="the wearer of the whole session")
    others.add_argument(
        "--regression", action="store_true", help="use this session to judge every model, never to learn from"
    )
    others.add_argument("--ls", action="store_true", help="list the valid labels")
    made.add_argument("--remove", action="store_true", help="remove the named label")
    return made
