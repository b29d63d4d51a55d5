"""Tries every order of events on the gateway's control path: python -m tests.explore."""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from tests.explore.player import parsed
from tests.explore.report import Found, noted
from tests.explore.scenes import SCENES, Scene
from tests.explore.search import Options, Search
from tests.explore.shared import Count, Shared
from tests.explore.shrink import replayed, shrunk

FOR_EVER_S = 1e9


def main() -> int:
    options = _options()
    if options.replay is not None:
        return _replay(options.replay)
    with tempfile.TemporaryDirectory(prefix="explore-") as folder:
        scenes = tuple(SCENES[name] for name in options.scenes or SCENES)
        asked = Options(
            options.seconds,
            options.seed,
            options.depth,
            options.workers,
            scenes,
            Path(folder) / "found.jsonl",
        )
        return _explore(asked)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="./dev explore", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long; 0: until all was tried")
    parser.add_argument("--seed", type=int, default=1, help="another one tries other orders first")
    parser.add_argument("--depth", type=int, default=2, help="how many events an order of the tree has")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--scenes", nargs="+", choices=list(SCENES), help="where runs begin; all of them")
    parser.add_argument("--replay", metavar="ORDER", help="play one order again, as a violation printed it")
    return parser.parse_args()


def _explore(options: Options) -> int:
    begun = time.monotonic()
    shared = Shared(options.workers)
    for number, scene in enumerate(options.scenes):
        left_s = (options.seconds or FOR_EVER_S) - (time.monotonic() - begun)
        until = time.monotonic() + left_s / (len(options.scenes) - number)
        for worker in [_spawn(worker, scene, options, shared, until) for worker in range(options.workers)]:
            os.waitpid(worker, 0)
    scratch = options.reports.with_name("shorter")
    found = [shrunk(one, scratch) for one in noted(options.reports)]
    for one in found:
        _say(one.words())
        _say("\n".join(one.frames))
    _say(_summary(shared, time.monotonic() - begun, found))
    return 1 if found else 0


def _spawn(worker: int, scene: Scene, options: Options, shared: Shared, until: float) -> int:
    child = os.fork()
    if child:
        return child
    shared.worker = worker
    code = 1
    try:
        Search(scene, options, shared, until).run()
        code = 0
    finally:
        os._exit(code)


def _replay(text: str) -> int:
    name, order = parsed(text)
    found = replayed(SCENES[name].build(), name, order)
    if found is None:
        _say("nothing is violated")
        return 0
    _say("\n".join([*found.frames, found.words()]))
    return 1


def _summary(shared: Shared, seconds: float, found: list[Found]) -> str:
    total = {what: shared.total(what) for what in Count}
    return (
        f"{total[Count.ORDERS]} orders tried, {total[Count.STATES]} distinct states, "
        f"{total[Count.RUNS]} runs "
        f"({total[Count.CUT]} cut), {total[Count.VIRTUAL_MS] / 3.6e6:.1f} virtual hours, "
        f"{seconds:.0f} s, {len(found)} violations"
    )


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    if os.environ.get("PYTHONHASHSEED") != "0":  # what a set is iterated in belongs to the order
        os.environ["PYTHONHASHSEED"] = "0"
        os.execv(sys.executable, [sys.executable, "-m", "tests.explore", *sys.argv[1:]])
    sys.exit(main())
