"""What goes wrong with who wears the machine: nothing is broken, and yet it does not walk as it should."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

from hil_sim.faults.fault import Fault, Number, Site, Target


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


FAULTS = {
    "gait_asymmetry": Fault(
        Target.WEARER,
        _gait_asymmetry,
        "The left step is longer than the right one: the ranges of the hips differ, stride by stride.",
        {
            "percent": Number(40.0, -80.0, 80.0, "%", "by how much the left step is longer than the right"),
            "impaired": Number(0.0, 0.0, 1.0, "", "how much the left leg stiffens, and bears less"),
        },
    ),
}
