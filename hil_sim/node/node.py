"""One CANopen device on the simulated bus: power, NMT, error control, and who gets which frame (CiA 301)."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator

import eds
from eds.description import Description
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.node import lss, nmt, pdo
from hil_sim.node.dictionary import IDENTITY, Dictionary, Key
from hil_sim.node.emergency import ALL_ERRORS, COMMUNICATION_ERRORS, Emergencies
from hil_sim.node.guarding import Guarding
from hil_sim.node.heartbeat import HeartbeatConsumer, HeartbeatProducer
from hil_sim.node.lss import Lss
from hil_sim.node.nmt import NmtService, NmtState
from hil_sim.node.pdos import Pdos
from hil_sim.node.sdo import SdoServer
from hil_sim.node.sdo_channel import SdoChannels
from hil_sim.node.storage import COMMUNICATION, EVERYTHING, Storage
from hil_sim.node.sync import Sync
from hil_sim.node.time_stamp import TimeStamp

BOOT_TIME_NS = 50 * MILLISECOND_NS

EMCY_LIFE_SIGN_LOST = 0x8130  # of node guarding, and of a watched heartbeat
EMCY_SYNC_LENGTH = 0x8240

Handler = Callable[[Frame], None]


class Node:
    """A device with the services of CiA 301; a profile is added by the `_on_…` methods of a subclass.

    Where it has no node id yet, `factory_node_id` is `lss.UNCONFIGURED`, and `node_id` the one that the
    description is for; LSS gives it another.
    """

    def __init__(self, clock: Clock, bus: CanBus, name: str, node_id: int, description: Description) -> None:
        self.clock = clock
        self.name = name
        self.node_id = node_id
        self.description = description
        self.dictionary = dictionary = Dictionary(description)
        self.storage = Storage(dictionary)
        self.state = NmtState.INITIALISING
        self.powered = False
        self._bus = bus
        self._boots = 0
        self._handlers: dict[int, tuple[Handler, ...]] = {}
        self._emergencies = Emergencies(clock, dictionary, self.send, self._communicates)
        self._heartbeat = HeartbeatProducer(clock, dictionary, self._send_heartbeat)
        self._consumer = HeartbeatConsumer(clock, dictionary, self._heartbeat_lost, self._heartbeat_back)
        self._guarding = Guarding(clock, dictionary, self._send_state, self._guard_lost, self._guard_back)
        self._sync = Sync(clock, dictionary, self.send, self._synchronise, self._wrong_sync, self._listen)
        self._pdos = Pdos(clock, dictionary, self.send, self._rpdo_error, self._listen)
        self._time = TimeStamp(clock, dictionary, self.send, self._listen)
        self._sdo = SdoChannels(clock, dictionary, lambda: self.node_id, self.send, self._listen)
        self.factory_node_id = node_id
        self.lss = Lss(clock, dictionary, _Layer(self), node_id, bus.bitrate)

    def number_serially(self, number: int) -> None:
        """Give the device its serial number (1018h:4), where it shows one."""
        entry = self.dictionary.get((IDENTITY, 4))
        if entry is not None:
            entry.default = entry.value = number

    # -- power and boot --------------------------------------------------------------------------------

    def power_on(self, boot_ns: int = BOOT_TIME_NS) -> None:
        """Switch the device on; it says so on the bus when it has booted."""
        self.powered = True
        self.storage.load()
        self._load_layer_settings()
        self._emergencies.forget()
        self._bus.attach(self, self._receive)
        self._boot(EVERYTHING, boot_ns)

    def power_off(self) -> None:
        """Switch the device off, without a word on the bus."""
        self.powered = False
        self._boots += 1
        self._bus.detach(self)
        self._fall_silent()
        self.state = NmtState.INITIALISING
        self._on_reset()

    def _load_layer_settings(self) -> None:
        self.lss.begin(*self.storage.layer_settings(self.factory_node_id, self.lss.bitrate))

    def _boot(self, objects: range, boot_ns: int) -> None:
        self._enter(NmtState.INITIALISING)
        self._fall_silent()
        self._adopt_node_id()
        self.storage.restore(objects)
        self._emergencies.reset(ALL_ERRORS if objects is EVERYTHING else COMMUNICATION_ERRORS)
        if objects is EVERYTHING:
            self._on_reset()
        self._boots += 1
        boot = self._boots
        self.clock.after(boot_ns, lambda: self._booted() if boot == self._boots else None)

    def _adopt_node_id(self) -> None:
        self.lss.adopt()
        if self.lss.configured and self.lss.node_id != self.node_id:
            self.node_id = self.lss.node_id
            before, self.description = self.description, eds.load(self.description.path, self.node_id)
            self.dictionary.readdress(before, self.description)

    def _booted(self) -> None:
        if not self.lss.configured:
            self._take({lss.REQUEST: (self._lss_received,)})
            return
        self._pdos.load()
        self._listen()
        self._send_heartbeat()
        self._enter(NmtState.PRE_OPERATIONAL)
        self._heartbeat.start()
        self._on_booted()
        if not self.dictionary.number(nmt.STARTUP, nmt.LEADS_OR_WAITS) & nmt.LEADS_OR_WAITS:
            self._enter(NmtState.OPERATIONAL)

    def _fall_silent(self) -> None:
        self._heartbeat.stop()
        self._consumer.stop()
        self._guarding.reset()
        self._stop_communicating()
        self._pdos.stop()
        self._take({})

    # -- what a profile adds ---------------------------------------------------------------------------

    def _on_reset(self) -> None:
        """Everything begins anew."""

    def _on_booted(self) -> None:
        """Note that the device has sent its boot-up message."""

    def _on_state(self, before: NmtState) -> None:
        """Take a changed NMT state."""

    def _on_sync(self) -> None:
        """Take a SYNC: RPDOs have taken effect, TPDOs are not yet sampled."""

    def _on_heartbeat(self, node_id: int, state: int) -> None:
        """Take another node's boot-up (`state` 0) or heartbeat."""

    def _own_handlers(self) -> Iterable[tuple[int, Handler]]:
        """More identifiers whose frames the profile wants."""
        return ()

    def _on_communication_lost(self) -> None:
        """Take the loss of the bus or of a life sign; the NMT state is still the one before."""

    # -- for the profile -------------------------------------------------------------------------------

    def send(self, identifier: int, data: bytes) -> None:
        if self.powered and self._hears:  # it may have been switched off by what it is just answering
            self._bus.send(Frame(identifier, data), self)

    def watched(self, key: Key) -> bool:
        """Return whether somebody wants to be told by `object_changed`."""
        return key in self._pdos.watched

    def object_changed(self, key: Key) -> None:
        """Tell event-driven PDOs that an object they carry has another value."""
        self._pdos.changed(key)

    def emergency(self, code: int, vendor: bytes = b"") -> None:
        self._emergencies.occurred(code, vendor)

    def emergency_over(self) -> None:
        self._emergencies.end_all()

    def bus_off(self) -> None:
        """React to bus off by 1029h and the profile."""
        self._communication_error()

    @property
    def time_of_day(self) -> tuple[int, int] | None:
        """Milliseconds after midnight and days since 1984, as TIME last said (1012h); `None`: never."""
        return self._time.taken

    # -- for who disturbs it -----------------------------------------------------------------------------

    def sdo_channels(self) -> dict[int, int]:
        """Return the SDO servers as they listen now: identifier of the requests to that of the answers."""
        return {channel.request: channel.response for channel in self._sdo.channels()}

    def tpdo_cob_ids(self) -> frozenset[int]:
        """Return the identifiers on which the device sends PDOs now."""
        return frozenset(tpdo.cob_id for tpdo in self._pdos.sent)

    # -- the bus ---------------------------------------------------------------------------------------

    @property
    def _hears(self) -> bool:
        """Whether it runs at the bus's bit rate; else its controller is off, and disturbs nobody."""
        return self.lss.bitrate == self._bus.bitrate

    def _receive(self, frame: Frame, _sender: object) -> None:
        if not frame.extended and self._hears:
            for handle in self._handlers.get(frame.cob_id, ()):
                handle(frame)

    def _listen(self) -> None:
        """Find out which frames are for this device, and what each is."""
        handlers = defaultdict(list)
        for identifier, handler in self._all_handlers():
            handlers[identifier].append(handler)
        self._take({identifier: tuple(several) for identifier, several in handlers.items()})

    def _take(self, handlers: dict[int, tuple[Handler, ...]]) -> None:
        self._handlers = handlers
        if self.powered:
            self._bus.accept(self, handlers)

    def _all_handlers(self) -> Iterator[tuple[int, Handler]]:
        yield nmt.NMT_COB_ID, self._nmt_received
        yield self._sync.cob_id, self._sync_received
        yield from self._time.handlers()
        yield lss.REQUEST, self._lss_received
        for node_id in range(1, 128):
            handler = self._guard_received if node_id == self.node_id else self._heartbeat_received
            yield nmt.HEARTBEAT_BASE + node_id, handler
        for channel in self._sdo.channels():
            yield channel.request, self._sdo_handler(channel.server)
        for rpdo in self._pdos.received:
            yield rpdo.cob_id, self._rpdo_handler(rpdo)
        for tpdo in self._pdos.sent:
            yield tpdo.cob_id, self._remote_handler(tpdo)
        yield from self._own_handlers()

    def _sdo_handler(self, server: SdoServer) -> Handler:
        def handle(frame: Frame) -> None:
            if self._communicates() and not frame.remote:
                server.receive(frame.data)

        return handle

    def _rpdo_handler(self, rpdo: pdo.Rpdo) -> Handler:
        def handle(frame: Frame) -> None:
            late = rpdo.synchronous and self._sync.window_over
            if self.state is NmtState.OPERATIONAL and not (frame.remote or late):
                rpdo.receive(frame.data)

        return handle

    def _remote_handler(self, tpdo: pdo.Tpdo) -> Handler:
        def handle(frame: Frame) -> None:
            if self.state is NmtState.OPERATIONAL and frame.remote:
                tpdo.requested()

        return handle

    # -- NMT -------------------------------------------------------------------------------------------

    def _nmt_received(self, frame: Frame) -> None:
        if len(frame.data) != 2 or frame.data[1] not in (0, self.node_id):
            return
        service = frame.data[0]
        if service in nmt.STATE_AFTER:
            self._enter(nmt.STATE_AFTER[service])
        elif service == NmtService.RESET_NODE:
            self._load_layer_settings()
            self._boot(EVERYTHING, BOOT_TIME_NS)
        elif service == NmtService.RESET_COMMUNICATION:
            self.reset_communication()

    def reset_communication(self) -> None:
        """Activate the settings that LSS has left pending."""
        self._boot(COMMUNICATION, BOOT_TIME_NS)

    def _enter(self, state: NmtState) -> None:
        before, self.state = self.state, state
        if state is before:
            return
        if before is NmtState.OPERATIONAL:
            self._pdos.stop()
        if state not in nmt.COMMUNICATING:
            self._stop_communicating()
        elif before not in nmt.COMMUNICATING:
            self._sync.start()
            self._time.start()
        if state is NmtState.OPERATIONAL:
            self._pdos.start()
        self._on_state(before)

    def _communicates(self) -> bool:
        return self.state in nmt.COMMUNICATING

    def _stop_communicating(self) -> None:
        self._sync.stop()
        self._time.stop()
        self._emergencies.silence()
        self._sdo.reset()

    # -- LSS -------------------------------------------------------------------------------------------

    def _lss_received(self, frame: Frame) -> None:
        """Not while it is operational, as strict devices have it."""
        if self.state is not NmtState.OPERATIONAL and not frame.remote:
            self.lss.received(frame.data)

    # -- SYNC and PDOs ---------------------------------------------------------------------------------

    def _sync_received(self, frame: Frame) -> None:
        if self._communicates() and not frame.remote:
            self._sync.received(frame.data)

    def _wrong_sync(self) -> None:
        self._emergencies.occurred(EMCY_SYNC_LENGTH)

    def _synchronise(self, counter: int | None) -> None:
        """Process a SYNC: received PDOs take effect, then those to send are sampled."""
        self._emergencies.ended(EMCY_SYNC_LENGTH)
        operational = self.state is NmtState.OPERATIONAL
        if operational:
            self._pdos.take()
        self._on_sync()
        if operational:
            self._pdos.synchronise(counter)

    def _rpdo_error(self, number: int, code: int, present: bool) -> None:
        change = self._emergencies.occurred if present else self._emergencies.ended
        change(code, (number + 1).to_bytes(2, "little"))

    # -- error control ---------------------------------------------------------------------------------

    def _send_heartbeat(self) -> None:
        self._send_state(bytes([self.state]))

    def _send_state(self, data: bytes) -> None:
        self.send(nmt.HEARTBEAT_BASE + self.node_id, data)

    def _guard_received(self, frame: Frame) -> None:
        """Ignore guarding while the heartbeat runs (CiA 301 §7.2.8.3)."""
        if frame.remote and self._guarding.supported and not self._heartbeat.running:
            self._guarding.requested(self.state)

    def _heartbeat_received(self, frame: Frame) -> None:
        if frame.remote or len(frame.data) != 1:
            return
        node_id, state = frame.cob_id - nmt.HEARTBEAT_BASE, frame.data[0] & 0x7F
        if state != NmtState.INITIALISING:  # a boot-up message is no heartbeat
            self._consumer.received(node_id)
        self._on_heartbeat(node_id, state)

    def _heartbeat_lost(self, node_id: int) -> None:
        self.emergency(EMCY_LIFE_SIGN_LOST, bytes([node_id]))
        self._communication_error()

    def _heartbeat_back(self, node_id: int) -> None:
        self._emergencies.ended(EMCY_LIFE_SIGN_LOST, bytes([node_id]))

    def _guard_lost(self) -> None:
        self.emergency(EMCY_LIFE_SIGN_LOST)
        self._communication_error()

    def _guard_back(self) -> None:
        self._emergencies.ended(EMCY_LIFE_SIGN_LOST)

    def _communication_error(self) -> None:
        self._on_communication_lost()
        behaviour = self.dictionary.number(nmt.ERROR_BEHAVIOUR)
        if self.state is NmtState.OPERATIONAL and behaviour in nmt.STATE_AFTER_ERROR:
            self._enter(nmt.STATE_AFTER_ERROR[behaviour])


class _Layer:
    """LSS's interface to its device."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def tell(self, data: bytes) -> None:
        self._node.send(lss.ANSWER, data)

    def keep(self, node_id: int, bitrate: int) -> None:
        self._node.storage.keep_layer_settings(node_id, bitrate)

    def node_id_given(self) -> None:
        self._node.reset_communication()

    def bitrate_changed(self) -> None:
        """Do nothing: each frame is checked by itself whether it hears and is heard."""
