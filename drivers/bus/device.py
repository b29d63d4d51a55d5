"""Any other CANopen device: it has parameters and a life, and no channels of its own."""

from drivers.bus.bus import CanBus
from drivers.bus.node import shared_node
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import DeviceSettings
from drivers.component import Kind
from drivers.latest import Latest
from drivers.samples import Channel, Quality, State
from eds import Description


class CanDevice:
    """One device by its name in the robot's file."""

    kind = Kind.DEVICE
    channels: tuple[Channel, ...] = ()

    def __init__(self, name: str, settings: DeviceSettings, bus: CanBus, description: Description) -> None:
        """Raises `SettingsError` where another table describes the same node differently."""
        self.name = name
        self.settings = settings
        self.node = shared_node(bus, settings.node_id, description, settings)
        self.latest = Latest(name, self.channels, settings.stale_after_s)

    def start(self) -> None:
        """Open the bus if nobody else has."""
        self.node.probe()
        self.node.attach(self, self.name)

    def stop(self) -> None:
        """Let go of the node."""
        self.node.detach(self)

    def quality(self, now_ns: int) -> Quality:
        """By its heartbeat, where it has one; else by whether it answers when it is asked now and then."""
        age_ms = self.node.life.silent_ms(now_ns)
        problem = self.node.problem(now_ns)
        silence = self.node.silence(now_ns)
        state = State.OK if self.node.ready else State.LOST
        if self.node.ready and self.node.life.lost(now_ns):
            lost = age_ms is not None and age_ms > self.settings.lost_after_s * 1000
            state = State.LOST if lost else State.STALE
        elif silence is not None:
            state, problem = State.LOST, silence
        elif self.node.ready and self.node.life.active_emcy is not None:
            state = State.FAULT
            problem = f"it reports {self.node.life.active_emcy.text(self.node.description.vendor_id)}"
        trouble = self.node.trouble
        texts = (problem, *(one.text(now_ns) for one in trouble), *self.node.findings)
        words = "; ".join(text for text in texts if text)
        return Quality(state, age_ms, words or None, self.node.counters(), trouble)

    def boot(self, sdo: SdoChannel) -> None:
        """Nothing needs to be read."""

    def forget(self) -> None:
        """Nothing was kept."""
