"""`gwrms blame`: when the robot's control loop is late, and who ran instead."""

import time
from collections import Counter

from gateway.amounts import NONE
from gateway.cli.arguments import seconds
from gateway.cli.connect import connect, parser
from gateway.cli.text import say, say_json, table
from gateway.wire.resource import Overrun, Overruns

POLL_S = 1.0

EPILOG = """The robot's file names the control loop and its frames:

  [control_loop]
  processes = ["exo_control"]    # as ps shows them, or the programs that they run; * for any letters
  bus = "main"
  can_id = 0x080                 # its SYNC, or one of its PDOs
  period_ms = 10
  late_ms = 2                    # after its time

The loop is watched only while this command runs. LATE is relative to the frame before; RAN and WAITED are
the control loop's own time since then: running, and ready to run while others ran. A process that ended in
between cannot be named."""

_REASONS = {"others_ran": "others ran", "own_work": "its own work", "asleep": "it slept"}


def main(argv: list[str]) -> int:
    """Run `gwrms blame`; Ctrl-C ends it with the summary."""
    made = parser("blame", "Watch the robot's control loop, and name the processes that delay it.", EPILOG)
    made.add_argument("--seconds", type=seconds, help="duration (default: until Ctrl-C)")
    arguments = made.parse_args(argv)
    end_s = float("inf") if arguments.seconds is None else time.monotonic() + arguments.seconds
    seen: list[Overrun] = []
    with connect(arguments, "blame") as robot:
        told = robot.overruns()
        try:
            while True:
                _show(told, seen, json=arguments.json)
                if time.monotonic() >= end_s:
                    break
                time.sleep(max(0.0, min(POLL_S, end_s - time.monotonic())))
                told = robot.overruns()
        except KeyboardInterrupt:
            pass
    if not arguments.json:
        say(summary(told, seen))
    return 0


def _show(told: Overruns, seen: list[Overrun], *, json: bool) -> None:
    seen += told.overruns
    for one in told.overruns:
        if json:
            say_json(one)
        else:
            say(f"{line(one)}\n")


def line(one: Overrun) -> str:
    """One overrun for people."""
    who = ", ".join(f"{ran.name} ({ran.pid}) {ran.ran_ms:.1f} ms" for ran in one.instead) or NONE
    own = f"ran {one.ran_ms:.1f} ms, waited {one.waited_ms:.1f} ms"
    return f"{one.late_ms:.1f} ms late: {_REASONS.get(one.reason, one.reason)} ({own}); ran instead: {who}"


def summary(told: Overruns, seen: list[Overrun]) -> str:
    """Return the processes most often named, with counts and total times."""
    control = ", ".join(f"{name} ({pid})" for pid, name in told.control.items()) or "none is there"
    head = f"\ncontrol loop: {control}; {told.missed} of {told.cycles} cycles late\n"
    first = Counter(one.instead[0].name for one in seen if one.reason == "others_ran" and one.instead)
    ran_ms: Counter[str] = Counter()
    for one in seen:
        for ran in one.instead[:1]:
            ran_ms[ran.name] += round(ran.ran_ms)
    rows = [(name, str(count), f"{ran_ms[name]} ms") for name, count in first.most_common()]
    for reason in ("own_work", "asleep"):
        count = sum(one.reason == reason for one in seen)
        rows += [(f"({_REASONS[reason]})", str(count), NONE)] if count else []
    return head + (table(("TO BLAME", "TIMES", "RAN"), rows, right=(1, 2)) if rows else "")
