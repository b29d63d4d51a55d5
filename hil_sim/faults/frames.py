"""The seam on the bus: a disturbance that acts as long as its fault."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from hil_sim.bus.can_bus import Disturbance
from hil_sim.faults.fault import Site


def disturbed_by(make: Callable[[Site], Disturbance]) -> Callable[[Site], AbstractContextManager[None]]:
    """Return a fault that is nothing but a disturbance of the bus."""

    @contextmanager
    def act(site: Site) -> Iterator[None]:
        with disturbing(site, make(site)):
            yield

    return act


@contextmanager
def disturbing(site: Site, disturbance: Disturbance) -> Iterator[None]:
    """Let a disturbance act on the bus meanwhile."""
    site.robot.bus.disturbances.append(disturbance)
    yield
    site.robot.bus.disturbances.remove(disturbance)
