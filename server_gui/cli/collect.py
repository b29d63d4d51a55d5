"""`gwrms collect`: record every robot into the store, without a window; and how that goes."""

import argparse
import contextlib
import gc
import logging
import os
import sys
import time
from datetime import datetime
from pathlib import Path

import msgspec

from gateway.amounts import NONE, age, size
from gateway.cli.text import say, table, warn
from gateway.plain_text import json_plain, plain
from ml.store.private import private_files
from server_gui.cli.wearer_notes import add_worn, worn
from server_gui.core.fleet.collector import Collector, CollectorReport
from server_gui.core.fleet.control_socket import ask, why_not_uploaded
from server_gui.core.fleet.link_statistics import LinkReport
from server_gui.core.prediction.state import (
    WITHIN_DAYS,
    DangerReport,
    Figures,
    PredictingState,
    Quality,
    TaskReport,
)
from server_gui.core.recording.records import Worn
from server_gui.core.settings.server_file import ServerSettings, SettingsError, add_robots, default_file, load
from server_gui.core.threads.supervision import BEAT_S
from server_gui.processes.shutdown_signals import ShutdownRequested, ShutdownSignals

log = logging.getLogger(__name__)

UNIT = Path(__file__).with_name("collect.service")
LOOK_S = BEAT_S  # between looks whether it is to end, and whether its threads move
HEADER = (
    "robot", "address", "link", "quality", "since", "links", "rows/s", "received/s", "rows", "missed",
    "dropped", "newest", "round trip", "clock",
)  # fmt: skip
RIGHT = range(5, len(HEADER))
PREDICTED = ("robot", "task", "says", "probability", "age", "trust", "model")
LABELLED = ("robot", "task", "model", "labelled", "recordings", "right", "wrong", "not said")

EPILOG = """A robot's data is saved in the spool on this computer first, and goes to the store in batches;
nothing is decimated, and what is missing is recorded as an event. Each robot is followed separately: one that
is off is tried again until it answers. End the collector with Ctrl-C or SIGTERM: sessions are ended, and
pending data is uploaded, for 20 s at most.

the server's file (without --config: ~/.config/gwrms/server.toml, if it is there)
  [robots]
  exo-01 = "192.0.2.7:7420"        # its name in the store

  [store]
  url = "s3://bucket/prefix"       # default: a folder, file:///home/YOU/.local/share/gwrms/store

  [recorder]
  spool = "/var/lib/gwrms/spool"   # default: ~/.local/share/gwrms/spool
  upload = "always"                # as soon as a batch is full; idle: while no robot has sent rows for 10 s,
                                   # or more than 2 GiB wait; manual: with --upload
  rate_hz = 100                    # rows a second; 0: every sample of every source
  channels = ["*"]                 # names or globs
  resources_s = 5                  # period of measuring the robots' computers
  batch_s = 60                     # length of recording in one upload

  [prediction]
  enabled = true                   # predictions are recorded, too: gwrms docs predict

examples
  gwrms collect --robot exo-01=192.0.2.7:7420 --operator Ada --notes "new insoles"
  gwrms collect --status
  gwrms collect --mark "stairs, second try"
  gwrms collect --unit | sudo tee /etc/systemd/system/gwrms-collect.service

exit status
  0 ended as asked, or a collector has answered; 1 it cannot record, no collector answers, its last
  upload failed (--upload), or rows are lost without an event; 2 usage"""


def main(argv: list[str]) -> int:
    """Run `gwrms collect`."""
    private_files()
    arguments = _parser().parse_args(argv)
    if arguments.unit:
        say(UNIT.read_text(encoding="utf-8").replace("@PYTHON@", sys.executable))
        return 0
    settings = add_robots(load(arguments.config), dict(arguments.robot))
    spool = settings.recorder.spool
    if arguments.status:
        return _status(spool, as_json=arguments.json)
    if arguments.upload:
        ask(spool, "upload")
        say("the collector uploads what it has; gwrms collect --status tells how that goes\n")
        problem = why_not_uploaded(spool)
        if problem is None:
            return 0
        warn("collect", f"it tries again, and could not the last time: {problem}")
        return 1
    if arguments.mark is not None:
        return _mark(spool, arguments.mark)
    if not settings.robots:
        file = arguments.config or default_file()
        raise SettingsError(f"no robot is named: write it into [robots] of {file}, or --robot NAME=HOST:PORT")
    return _collect(settings, arguments.operator, arguments.notes, worn(arguments))


def _mark(spool: Path, text: str) -> int:
    count = int(ask(spool, "mark", text))
    if not count:
        warn("collect", "not marked: nothing is being recorded; gwrms collect --status says why")
        return 1
    say(f"marked in the {'recording of 1 robot' if count == 1 else f'recordings of {count} robots'}\n")
    return 0


def _collect(settings: ServerSettings, operator: str, notes: str, worn: Worn) -> int:
    _log_to_stderr()
    gc.freeze()  # what was loaded so far lives as long as the process, and there is much of it
    collecting = Collector(settings, operator, notes, worn=worn)
    with ShutdownSignals() as ending, contextlib.suppress(ShutdownRequested), collecting as collector:
        names = ", ".join(settings.robots)
        log.info("recording %s into %s, for the store %s", names, settings.recorder.spool, settings.store.url)
        while True:
            ending.check()
            collector.wait(LOOK_S)
    status = 0
    if collector.untold:
        log.error("%d rows are lost, and no event tells of them: see above", collector.untold)
        status = 1
    log.info("ended")
    if collector.hangs:
        logging.shutdown()
        os._exit(status)  # what an upload under way has done is found out at the next start
    return status


def _log_to_stderr() -> None:
    """Log lines; in systemd's journal without the time, which it adds itself."""
    time = "" if "JOURNAL_STREAM" in os.environ else "%(asctime)s "
    logging.basicConfig(level=logging.WARNING)
    for handler in logging.getLogger().handlers:
        handler.setFormatter(PlainLines(f"{time}%(levelname)s %(message)s"))
    logging.getLogger("server_gui").setLevel(logging.INFO)


class PlainLines(logging.Formatter):
    """One line a record, whatever a robot says in it."""

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's own name
        return plain(super().formatMessage(record))


def _status(spool: Path, *, as_json: bool) -> int:
    answer = ask(spool, "status")
    if as_json:
        say(json_plain(answer.decode().rstrip()) + "\n")
    else:
        say(status_text(msgspec.json.decode(answer, type=CollectorReport)))
    return 0


def status_text(report: CollectorReport) -> str:
    """Return a collector's report, for people."""
    recorder, uploader = report.recorder, report.uploader
    rows = f"{recorder.recorded} rows since then, {recorder.waiting} wait for the disk, {recorder.lost} lost"
    batches = (
        f"{_batches(uploader.uploaded)} uploaded, {uploader.waiting} wait (upload = {report.upload.value})"
    )
    lines = [
        f"collecting since {_instant(report.began_utc_s)} (process {report.pid}, gwrms {report.version})",
        f"spool  {report.spool}: {rows}; {size(report.disk_free_bytes)} free on its disk",
        f"store  {report.store}: {batches}; backlog {size(uploader.backlog_bytes)}",
        *(f"ALARM  {trouble.text}" for trouble in report.threads),
        *(f"ALARM  {alarm.text}" for alarm in recorder.alarms),
        *([f"ALARM  {uploader.problem}"] if uploader.problem else []),
        *(f"ALARM  {problem}" for problem in (*uploader.lost, *uploader.ahead)),
        *(
            f"ALARM  {file} is damaged: what is damaged of it is not in the store"
            for file in uploader.damaged
        ),
    ]
    robots = report.robots.items()
    links = table(HEADER, [_row(name, link) for name, link in robots], RIGHT)
    problems = "".join(
        f"{name}: {plain(reason)}\n" for name, link in robots for reason in link.quality.reasons
    )
    return "\n".join([*lines, "", links, *([problems] if problems else []), *_predicted(report.prediction)])


def _batches(count: int) -> str:
    return "1 batch" if count == 1 else f"{count} batches"


def _predicted(state: PredictingState | None) -> list[str]:
    """Return the newest predictions of the robots, and problems of models."""
    if state is None:
        return ["prediction is off\n"]
    rows = [
        (robot, *_task(name, known)) for robot, tasks in state.robots.items() for name, known in tasks.items()
    ]
    skipped = [f"{state.skipped} decisions were skipped: too much to do\n"] if state.skipped else []
    return [
        *([table(PREDICTED, rows, (3, 4))] if rows else []),
        *([] if state.labelled is None else [_labelled(state.labelled)]),
        *skipped,
        *(f"{robot}: {text}\n" for robot, text in state.adapting.items() if text),
        *(_danger(robot, told) for robot, told in state.dangers.items()),
        *(f"{one}\n" for one in state.problems),
    ]


def _danger(robot: str, told: DangerReport) -> str:
    return f"{robot}: danger, {age(time.time() - told.utc_s)} ago: {told.text}\n"


def _labelled(found: Figures) -> str:
    """Return how right predictions were, by labels."""
    if not found:
        return f"no prediction of the last {WITHIN_DAYS} days is labelled in the store (gwrms label)\n"
    rows = [
        (robot, task, model, quality.duration, str(quality.recordings), *_shares(quality))
        for robot, tasks in found.items()
        for task, models in tasks.items()
        for model, quality in models.items()
    ]
    return (
        f"predictions of the last {WITHIN_DAYS} days that are labelled\n{table(LABELLED, rows, range(3, 8))}"
    )


def _shares(quality: Quality) -> tuple[str, str, str]:
    """Return the share of right, wrong and withheld predictions, if enough was labelled to tell."""
    return quality.shares if quality.is_enough else ("too little", NONE, NONE)


def _task(name: str, known: TaskReport) -> tuple[str, ...]:
    drifted = f": {', '.join(known.drifted)}" if known.drifted else ""
    newest = age(time.time() - known.utc_s)
    return name, known.label, f"{known.probability:.2f}", newest, f"{known.trust}{drifted}", known.model


def _row(name: str, link: LinkReport) -> tuple[str, ...]:
    return (
        name,
        link.address,
        link.state,
        link.quality.health.value,
        NONE if link.since_utc_s is None else _instant(link.since_utc_s),
        str(link.links),
        f"{link.rows_per_s:.0f}",
        NONE if link.received_per_s is None else size(link.received_per_s),
        str(link.rows),
        str(link.missed),
        str(link.dropped),
        age(link.newest_age_s),
        age(link.quality.round_trip),
        NONE if link.clock_uncertainty_s is None else f"±{1e3 * link.clock_uncertainty_s:.2f} ms",
    )


def _instant(utc_s: float) -> str:
    return datetime.fromtimestamp(utc_s).astimezone().strftime("%Y-%m-%d %H:%M:%S")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms collect",
        description="Record all robots into the store; show the status of the running collector.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--config", type=Path, metavar="FILE", help="the server's file")
    parser.add_argument(
        "--robot",
        type=_robot,
        action="append",
        default=[],
        metavar="NAME=HOST:PORT",
        help="a robot in addition to those of the file; repeatable",
    )
    parser.add_argument(
        "--operator", default="", metavar="WHO", help="operator's name; kept with the sessions"
    )
    parser.add_argument("--notes", default="", metavar="TEXT", help="kept with the sessions")
    add_worn(parser)
    asking = parser.add_mutually_exclusive_group()
    asking.add_argument("--status", action="store_true", help="show the status of the running collector")
    asking.add_argument("--upload", action="store_true", help="make it upload pending data now")
    asking.add_argument("--mark", metavar="TEXT", help="mark this instant in every robot's recording")
    asking.add_argument("--unit", action="store_true", help="print a systemd unit for this installation")
    parser.add_argument(
        "--json", action="store_true", help="with --status: print one JSON object, for programs"
    )
    return parser


def _robot(text: str) -> tuple[str, str]:
    name, equals, address = text.partition("=")
    if not (name and equals and address):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=HOST:PORT")
    return name, address
