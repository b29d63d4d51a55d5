"""Plays what may happen on the way of a row: python -m tests.explore_store."""

import argparse
import logging
import subprocess
import sys
from collections.abc import Mapping

from tests.explore.command import DEFAULT_S, Mistake, parser, put_back_if, run


def main() -> int:
    options = _options()
    logging.disable(logging.CRITICAL)
    put_back_if(options.with_defect, _defects)
    # Only now: with the first import of anything of the path it is too late for a defect.
    if options.defects is not None:
        from tests.explore_store.defects import judge

        return judge(options.defects, options.seconds, _say)
    if options.test is not None:
        import pytest

        return int(pytest.main([f"tests/unit/{options.test}", "-q", "-x", "-p", "no:cacheprovider"]))
    if options.replay:
        return max(_replay(play) for play in options.replay)
    if options.workers > 1:
        return _side_by_side(options)
    return _search(options.seconds, options.seed, options.words, options.saying)


def _defects() -> Mapping[str, Mistake]:
    from tests.explore_store.defects import DEFECTS

    return DEFECTS


def _options() -> argparse.Namespace:
    made = parser("./dev explore store", __doc__, replay="append")
    add = made.add_argument
    add("--seconds", type=float, default=DEFAULT_S, help="how long")
    add("--seed", type=int, default=1, help="another one plays something else")
    add("--workers", type=int, default=1, help="so many side by side, each with a seed of its own")
    add("--words", nargs="+", default=[], metavar="WORD", help="only these steps")
    add("--test", metavar="TEST", help="run this test below tests/unit, with a defect put back")
    return made.parse_args()


def _search(seconds: float, seed: int, words: list[str], saying: str) -> int:
    from tests.explore_store.searching import search, told
    from tests.explore_store.steps import KINDS

    if unknown := set(words) - set(KINDS):
        _say(f"there is no step {', '.join(sorted(unknown))}; there are {', '.join(KINDS)}")
        return 2
    found = search(seconds, seed, words or tuple(KINDS), saying)
    _say(
        f"{found.plays} plays of {found.steps} steps, {found.points} points where a program might have ended"
        + (
            f"; {found.known} plays had in them what is not mended yet (KNOWN in searching.py)"
            if found.known
            else ""
        )
    )
    if found.wrong is None:
        return 0
    assert found.error is not None
    _say(f"seed {found.seed}: {told(found.error)}\n./dev explore store --replay '{found.wrong}'")
    return 1


def _replay(text: str) -> int:
    from tests.explore_store.s3 import S3
    from tests.explore_store.searching import played, told
    from tests.explore_store.steps import Script

    try:
        script = Script.parsed(text)
    except (ValueError, LookupError) as error:
        _say(str(error))
        return 2
    try:
        with S3() as s3:
            points = played(script, s3).disk.points
    except Exception as error:  # noqa: BLE001 - that is what it is for
        _say(told(error))
        return 1
    _say(f"nothing is wrong: {points} points")
    return 0


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _side_by_side(options: argparse.Namespace) -> int:
    more = ["--words", *options.words] if options.words else []
    more += ["--with-defect", options.with_defect] if options.with_defect else []
    runs = [
        subprocess.Popen(
            [sys.executable, "-m", "tests.explore_store", "--seconds", str(options.seconds),
             "--seed", str(options.seed * 1_000 + number), *more]
        )
        for number in range(options.workers)
    ]  # fmt: skip
    return max([run.wait() for run in runs])


if __name__ == "__main__":
    run("tests.explore_store", main)
