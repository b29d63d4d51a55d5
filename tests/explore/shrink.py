"""Makes an order shorter that led to a violation: leaves out every event that it does not take."""

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec

from tests.explore.invariants import Judged
from tests.explore.player import Order, Player
from tests.explore.report import Found
from tests.explore.scenes import SCENES
from tests.explore.stage import Stage, Violation


def replayed(stage: Stage, scene: str, order: Order) -> Found | None:
    """What is violated when it is played on this stage; the stage is of no more use then."""
    try:
        Player(stage).replay(order)
    except Violation:
        return Found.of(scene, order, stage.findings[0], stage.frames)
    return None


def shrunk(found: Found, scratch: Path, judged: Judged) -> Found:
    """The same violation by a shorter order, as far as there is one. Forks."""
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        return msgspec.json.decode(scratch.read_bytes(), type=Found) if scratch.exists() else found
    try:
        scratch.write_bytes(msgspec.json.encode(_shorter(found, scratch, judged)))
    finally:
        os._exit(0)


def _shorter(found: Found, scratch: Path, judged: Judged) -> Found:
    stage = SCENES[found.scene].build(judged)
    tried = True
    while tried:
        tried = False
        for order in _less(found.order):
            shorter = _try(stage, found, order, scratch)
            if shorter is not None:
                found, tried = shorter, True
                break
    return found


def _less(order: Order) -> Iterator[Order]:
    """Each event left out; what follows comes when it came."""
    for at in reversed(range(len(order))):
        after = order[at + 1 :]
        if after:
            after = ((order[at][0] + after[0][0], after[0][1]), *after[1:])
            yield (*order[:at], order[at + 1], *order[at + 2 :])
        yield (*order[:at], *after)


def _try(stage: Stage, found: Found, order: Order, scratch: Path) -> Found | None:
    scratch.unlink(missing_ok=True)
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        again = msgspec.json.decode(scratch.read_bytes(), type=Found) if scratch.exists() else None
        return again if again is not None and again.kind == found.kind else None
    try:
        again = replayed(stage, found.scene, order)
        if again is not None:
            scratch.write_bytes(msgspec.json.encode(again))
    finally:
        os._exit(0)
