"""Feeds anything to what reads bytes from outside: python -m tests.fuzz."""

import argparse
import sys

from tests.fuzz.catalogue import HERE, NAMES, about
from tests.fuzz.running import Outcome, is_guided, run

DEFAULT_S = 60.0
FOUND = HERE / "found"


def main() -> int:
    options = _options()
    if options.seeded is not None:
        from tests.fuzz.seeding import judge

        return judge(options.seeded, options.seconds)
    if options.target is None:
        _say("\n".join(f"{name:14} {about(name)}" for name in NAMES))
        return 0
    if not is_guided():
        _say("atheris is not here (it is for Linux, x86-64, Python 3.11 to 3.13): nothing guides the search")
    return _tell(options.target, run(options.target, options.seconds, seed=options.seed))


def _tell(name: str, outcome: Outcome) -> int:
    rate = outcome.executions / max(outcome.seconds, 1e-3)
    _say(f"{name}: {outcome.executions} executions in {outcome.seconds:.0f} s ({rate:.0f} a second)")
    if outcome.said is None:
        _say("nothing found")
        return 0
    FOUND.mkdir(exist_ok=True)
    file = FOUND / f"{name}-{len(list(FOUND.iterdir()))}"
    file.write_bytes(outcome.data)
    _say(f"{outcome.said}\n{len(outcome.data)} bytes, kept in {file}: {outcome.data[:200]!r}")
    return 1


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="./dev fuzz", description=__doc__)
    add = parser.add_argument
    add("target", nargs="?", choices=NAMES, metavar="TARGET", help="without it, all are listed")
    add("seconds", nargs="?", type=float, default=DEFAULT_S, help="how long (%(default)g)")
    add("--seed", type=int, default=1, help="another one tries other inputs")
    add("--seeded", nargs="*", metavar="DEFECT", help="look for each of these defects, or of all, put back")
    return parser.parse_args()


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


if __name__ == "__main__":
    raise SystemExit(main())
