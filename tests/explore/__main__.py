"""Tries every order of events on the gateway's control path: python -m tests.explore."""

import argparse
import os
import sys

DEFAULT_S = 60.0


def main() -> int:
    options = _options()
    if options.with_defect is not None:
        from tests.explore.defects import DEFECTS
        from tests.explore.mutating import put_back

        put_back(DEFECTS[options.with_defect].parts)
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


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="./dev explore", description=__doc__)
    add = parser.add_argument
    add("--seconds", type=float, default=DEFAULT_S, help="how long; 0: until the whole tree was tried")
    add("--seed", type=int, default=1, help="another one tries other orders first")
    add("--depth", type=int, default=2, help="how many events an order of the tree has")
    add("--workers", type=int, default=os.cpu_count() or 1)
    add("--scenes", nargs="+", default=[], metavar="SCENE", help="where runs begin; else each of them")
    add("--events", nargs="+", default=[], metavar="EVENT", help="only these happen")
    add("--only", nargs="+", default=[], metavar="INVARIANT", help="nothing else is judged")
    add("--ignore", nargs="+", default=[], metavar="INVARIANT", help="what is not judged")
    add("--saying", default="", metavar="PATTERN", help="only violations that say this count")
    add("--first", action="store_true", help="end with the first violation")
    add("--replay", metavar="ORDER", help="play one order again, as a violation printed it")
    add("--with-defect", metavar="DEFECT", help="put this defect back before")
    add("--defects", nargs="*", metavar="DEFECT", help="look for each of these, or of all, put back")
    return parser.parse_args()


if __name__ == "__main__":
    if os.environ.get("PYTHONHASHSEED") != "0":  # what a set is iterated in belongs to the order
        os.environ["PYTHONHASHSEED"] = "0"
        os.execv(sys.executable, [sys.executable, "-m", "tests.explore", *sys.argv[1:]])
    sys.exit(main())
