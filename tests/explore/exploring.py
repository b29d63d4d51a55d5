"""One exploration: scene after scene, each by some processes, then what they found in its shortest form."""

import os
import sys
import tempfile
import time
import traceback
from collections.abc import Sequence
from pathlib import Path

from tests.explore.events import EVENTS
from tests.explore.invariants import Judged
from tests.explore.player import parsed
from tests.explore.report import Found, noted
from tests.explore.scenes import SCENES, Scene
from tests.explore.search import Options, Search
from tests.explore.shared import Count, Shared
from tests.explore.shrink import replayed, shrunk

FOR_EVER_S = 1e9


def explore(
    *,
    seconds: float,
    seed: int,
    depth: int,
    workers: int,
    scenes: Sequence[str],
    events: Sequence[str],
    judged: Judged,
    first: bool,
) -> int:
    """Look for violations, and say what was found; the exit status."""
    with tempfile.TemporaryDirectory(prefix="explore-") as folder:
        options = Options(
            seconds,
            seed,
            depth,
            workers,
            tuple(EVENTS[name] for name in events or EVENTS),
            judged,
            first,
            time.time(),
            Path(folder) / "found.jsonl",
        )
        return _explore(options, [SCENES[name] for name in scenes or SCENES])


def replay(text: str, judged: Judged) -> int:
    """Play one order again, and show the frames."""
    name, order = parsed(text)
    found = replayed(SCENES[name].build(judged), name, order)
    if found is None:
        say("nothing is violated")
        return 0
    say("\n".join([*found.frames, found.words()]))
    return 1


def say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _explore(options: Options, scenes: Sequence[Scene]) -> int:
    shared = Shared(options.workers)
    for number, scene in enumerate(scenes):
        left_s = (options.seconds or FOR_EVER_S) - (time.time() - options.begun)
        until = time.monotonic() + left_s / (len(scenes) - number)
        for worker in [_spawn(worker, scene, options, shared, until) for worker in range(options.workers)]:
            if os.waitpid(worker, 0)[1]:
                say(f"the search could not be made in the scene {scene.name}: see above")
                return 2
        if options.ended:
            break
    seconds = time.time() - options.begun
    scratch = options.reports.with_name("shorter")
    found = [shrunk(one, scratch, options.judged) for one in noted(options.reports)]
    for one in found:
        say("\n".join([one.words(), *one.frames]))
    say(_summary(shared, seconds, found))
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
    except BaseException:  # noqa: BLE001 - whatever it is: a search that did not take place has found nothing
        traceback.print_exc()
    finally:
        os._exit(code)


def _summary(shared: Shared, seconds: float, found: list[Found]) -> str:
    total = {what: shared.total(what) for what in Count}
    return (
        f"{total[Count.ORDERS]} orders tried, {total[Count.STATES]} distinct states, "
        f"{total[Count.RUNS]} runs ({total[Count.CUT]} cut), {total[Count.VIRTUAL_MS] / 3.6e6:.1f} virtual "
        f"hours, {seconds:.0f} s, {len(found)} violations"
    )
