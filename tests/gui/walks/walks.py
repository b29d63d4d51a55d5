"""The walks: what integrator, bench tester and developer do and expect to see, moment by moment."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from tests.gui.walks import commissioning, desk, first_run, robot
from tests.gui.walks.walk import Bench, Made, bench, demo

Moment = Callable[[Bench], None]


@dataclass(frozen=True)
class Walk:
    """Moments, one after the other, at what is made for them."""

    moments: tuple[Moment, ...]
    made: Made = bench


SHORT: Final = Walk((robot.alive, robot.stopped))
IN_DOCS: Final = Walk(
    (
        robot.alive,
        desk.pages,
        desk.a_core_is_eaten,
        desk.tuning,
        desk.trial_runs_out,
        desk.replay,
        desk.uploaded,
        commissioning.commissioned,
        robot.stopped,
    )
)
# What the pictures of the docs are called, by the moment that they keep.
PICTURES: Final = {
    "alive": "overview",
    "signals": "signals",
    "objects": "objects",
    "eaten": "resources",
    "review": "review",
    "trial": "trial",
    "run-out": "reverted",
    "labelled": "playback",
    "cloud": "cloud",
    "commission": "commission",
    "stopped": "stopped",
}
WALKS: Final = {
    "newcomer": Walk((first_run.starting, first_run.tour, first_run.break_something), demo),
    "integrator": Walk(
        (
            robot.alive,
            desk.keys,
            robot.one_glance,
            robot.stopped,
            robot.link_cut,
            commissioning.commissioned,
            first_run.empty,
            robot.two_robots,
        )
    ),
    "bench-tester": Walk(
        (
            robot.alive,
            desk.tuning,
            desk.trial_runs_out,
            desk.edits,
            robot.drive_fault,
            robot.fault_replayed,
            robot.insole_lost,
            robot.bus_in_trouble,
        )
    ),
    "developer": Walk(
        (
            robot.alive,
            desk.pages,
            desk.recording,
            desk.replay,
            desk.uploaded,
            desk.side_by_side,
            desk.learning,
            desk.store_gone,
        )
    ),
}
