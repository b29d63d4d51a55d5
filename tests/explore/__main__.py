"""Tries every order of events on the gateway's control path: python -m tests.explore."""

import argparse
import os
from collections.abc import Mapping

from tests.explore.command import DEFAULT_S, Mistake, parser, put_back_if, run


def main() -> int:
    options = _options()
    put_back_if(options.with_defect, _defects)
    # Only now: with the first import of anything of the gateway it is too late for a defect.
    from tests.explore import exploring
    from tests.explore.invariants import Judged

    judged = Judged(tuple(options.only), tuple(options.ignore), options.saying)
    if options.replay is not None:
        return exploring.replay(options.replay, judged)
    if options.defects is not None:
        from tests.explore.judging import judge

        return judge(options.defects, options.seconds, options.workers)
    return exploring.explore(
        seconds=options.seconds,
        seed=options.seed,
        depth=options.depth,
        workers=options.workers,
        scenes=tuple(options.scenes),
        events=tuple(options.events),
        judged=judged,
        first=options.first,
    )


def _defects() -> Mapping[str, Mistake]:
    from tests.explore.defects import DEFECTS

    return DEFECTS


def _options() -> argparse.Namespace:
    made = parser("./dev explore", __doc__)
    add = made.add_argument
    add("--seconds", type=float, default=DEFAULT_S, help="how long; 0: until the whole tree was tried")
    add("--seed", type=int, default=1, help="another one tries other orders first")
    add("--depth", type=int, default=2, help="how many events an order of the tree has")
    add("--workers", type=int, default=os.cpu_count() or 1)
    add("--scenes", nargs="+", default=[], metavar="SCENE", help="where runs begin; else each of them")
    add("--events", nargs="+", default=[], metavar="EVENT", help="only these happen")
    add("--only", nargs="+", default=[], metavar="INVARIANT", help="nothing else is judged")
    add("--ignore", nargs="+", default=[], metavar="INVARIANT", help="what is not judged")
    add("--first", action="store_true", help="end with the first violation")
    return made.parse_args()


if __name__ == "__main__":
    run("tests.explore", main)
