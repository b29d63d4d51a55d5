"""Any other CANopen device: it has parameters and a life, and the channels that the robot's file gives it."""

import threading

from drivers.bus.bus import CanBus
from drivers.bus.channels import Chosen, ObjectChannels, channels_of
from drivers.bus.node import shared_node
from drivers.bus.pdo import Tpdo, read_tpdos
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.settings import DeviceSettings
from drivers.component import ComponentKind
from drivers.errors import DeviceTimeout, DriverError, Unavailable
from drivers.latest import Latest
from drivers.samples import Channel, ComponentState, Quality
from eds import Description


class CanDevice:
    """One device by its name in the robot's file; `chosen` are its objects that are channels."""

    kind = ComponentKind.DEVICE

    def __init__(
        self,
        name: str,
        settings: DeviceSettings,
        bus: CanBus,
        description: Description,
        chosen: Chosen | None = None,
    ) -> None:
        """Describe a device; raises `SettingsError` if another table describes its node differently."""
        self.name = name
        self.settings = settings
        self.node = shared_node(bus, settings.node_id, description, settings)
        self.channels: tuple[Channel, ...] = channels_of(name, chosen or {})
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        self._description = description
        self._unread: str | None = None  # why nothing is known of its PDOs
        self._started = False
        self._lock = threading.Lock()  # a boot may be under way when it stops
        self._objects = ObjectChannels(self.node, description, chosen or {}, self.latest)

    def start(self) -> None:
        """Open the bus if nobody else has."""
        with self._lock:
            self._started = True
        self.node.probe()
        self.node.attach(self, self.name)

    def stop(self) -> None:
        """Let go of the node."""
        with self._lock:
            self._started = False
        self.node.detach(self)
        self.forget()

    def quality(self, now_ns: int) -> Quality:
        """Judge by its heartbeat, if it has one; else by whether it answers when it is asked now and then."""
        age_ms = self.node.life.silent_ms(now_ns)
        problem = self.node.problem(now_ns)
        silence = self.node.silence(now_ns)
        state = ComponentState.OK if self.node.ready else ComponentState.LOST
        if self.node.ready and self.node.life.lost(now_ns):
            lost = age_ms is not None and age_ms > self.settings.lost_after_s * 1000
            state = ComponentState.LOST if lost else ComponentState.STALE
        elif silence is not None:
            state, problem = ComponentState.LOST, silence
        elif self.node.ready and self.node.life.active_emcy is not None:
            state = ComponentState.FAULT
            problem = f"it reports {self.node.life.active_emcy.text(self.node.description.vendor_id)}"
        trouble = self.node.trouble
        channels = (
            self._objects.problems(now_ns) if state in (ComponentState.OK, ComponentState.FAULT) else ()
        )
        texts = (
            problem,
            self._unread,
            *channels,
            *(one.text(now_ns) for one in trouble),
            *self.node.findings,
        )
        words = "; ".join(text for text in texts if text)
        counters = {"short_frames": self._objects.short_frames, **self.node.counters()}
        return Quality(state, age_ms, words or None, counters, trouble)

    def boot(self, sdo: SdoChannel) -> None:
        """Read which channels come by PDO."""
        if not self._objects:
            return
        tpdos, unread = self._tpdos(sdo)
        with self._lock:
            if self._started:
                self._unread = unread
                self._objects.install(tpdos)

    def _tpdos(self, sdo: SdoChannel) -> tuple[tuple[Tpdo, ...], str | None]:
        """Return the device's TPDOs; none, and the reason, if their mapping cannot be understood."""
        try:
            return read_tpdos(sdo, self._description), None
        except (DeviceTimeout, Unavailable):
            raise
        except DriverError as error:
            return (), f"its PDOs are not read: {error}"

    def forget(self) -> None:
        self._unread = None
        self._objects.forget()
        self.latest.clear()
