"""Faults of the wearer: nothing is broken, but the gait is not as it should be."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

from hil_sim.clock import MILLISECOND_NS
from hil_sim.faults.fault import Fault, FaultTarget, Number, Site
from hil_sim.gait.gaits import LEFT, RIGHT

Act = Callable[[Site], AbstractContextManager[None]]
_TICK_NS = 50 * MILLISECOND_NS


@contextmanager
def _gait_asymmetry(site: Site) -> Iterator[None]:
    generator = site.robot.controller.generator
    before = generator.wearer
    left, right = before.impairment
    generator.wearer = replace(
        before,
        asymmetry=before.asymmetry + site.number("percent") / 100.0,
        impairment=(max(left, site.number("impaired")), right),
    )
    yield
    generator.wearer = before


@contextmanager
def _fatigue(site: Site) -> Iterator[None]:
    """Return the left leg tires; where it stumbles at last, the trip comes when the foot has dropped."""
    generator, clock = site.robot.controller.generator, site.robot.clock
    before, began_s = generator.wearer, clock.now_s

    def tire() -> None:
        share = min(site.number("percent_per_s") / 100.0 * (clock.now_s - began_s), 1.0)
        asymmetry = before.asymmetry + share * site.number("asymmetry")
        left, right = before.impairment
        generator.wearer = replace(before, asymmetry=asymmetry, impairment=(max(left, share), right))

    tiring = clock.every(_TICK_NS, tire)
    yield
    tiring.cancel()
    generator.wearer = before


def _falls(pitch: float, roll: float, *, slipping: bool = False) -> Act:
    """Return a fall from which the wearer gets up when the fault is over."""

    @contextmanager
    def act(site: Site) -> Iterator[None]:
        side = site.random.choice((-1.0, 1.0))
        site.robot.controller.generator.fall.start(side * roll, pitch, slipping=slipping)
        yield

    return act


@contextmanager
def _trip_and_fall(site: Site) -> Iterator[None]:
    generator = site.robot.controller.generator
    generator.trip(site.random.choice((LEFT, RIGHT)))
    falling = site.robot.clock.after(round(site.number("after_s") * 1e9), lambda: generator.fall.start(0.0))
    yield
    falling.cancel()


FAULTS = {
    "fatigue": Fault(
        FaultTarget.WEARER,
        _fatigue,
        "Stride by stride the left leg bends less in swing, bears less and steps longer.",
        {
            "percent_per_s": Number(6.0, 0.1, 100.0, "%/s", "of its strength that is lost"),
            "asymmetry": Number(0.3, -0.8, 0.8, "", "share by which the left step is longer at last"),
        },
    ),
    "fall_sideways": Fault(
        FaultTarget.WEARER,
        _falls(0.2, 1.2),
        "The trunk rolls over to one side, and lies 0.85 s later.",
        momentary=True,
    ),
    "fall_backward": Fault(
        FaultTarget.WEARER,
        _falls(-1.2, 0.1),
        "The trunk goes over backward, and lies 0.85 s later.",
        momentary=True,
    ),
    "foot_slips": Fault(
        FaultTarget.WEARER,
        _falls(-1.1, 0.25, slipping=True),
        "The feet bear less at once, the trunk goes over backward and aside, and lies 0.85 s later.",
        momentary=True,
    ),
    "trip_and_fall": Fault(
        FaultTarget.WEARER,
        _trip_and_fall,
        "A leg is held in its swing, the trunk pitches forward, and the wearer does not recover.",
        {"after_s": Number(0.35, 0.05, 2.0, "s", "from the trip to the fall")},
    ),
    "gait_asymmetry": Fault(
        FaultTarget.WEARER,
        _gait_asymmetry,
        "The left step is longer than the right one: the ranges of the hips differ, stride by stride.",
        {
            "percent": Number(40.0, -80.0, 80.0, "%", "by how much the left step is longer than the right"),
            "impaired": Number(0.0, 0.0, 1.0, "", "how much the left leg stiffens, and bears less"),
        },
    ),
}
