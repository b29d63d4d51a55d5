"""One CANopen device on the simulated bus: boot, NMT, SDO, PDOs, EMCY and heartbeat of CiA 301."""

from collections.abc import Callable

from eds.description import Description
from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.node import nmt, pdo
from hil_sim.node.dictionary import Dictionary, Key
from hil_sim.node.emergency import Emergencies
from hil_sim.node.heartbeat import HeartbeatConsumer, HeartbeatProducer
from hil_sim.node.nmt import NmtService, NmtState
from hil_sim.node.sdo import SdoServer
from hil_sim.node.storage import COMMUNICATION, EVERYTHING, Storage

BOOT_TIME_NS = 50 * MILLISECOND_NS
SYNC = (0x1005, 0)
SDO_SERVERS = (0x1200, 0x127F)

COMMUNICATION_ERROR_BEHAVIOUR = (0x1029, 1)
EMCY_PDO_TOO_SHORT = 0x8210
EMCY_HEARTBEAT_LOST = 0x8130

_INVALID = 1 << 31
_COB_ID = 0x7FF


class Node:
    """A device with the services of CiA 301; a profile is added by the `_on_…` methods of a subclass."""

    def __init__(self, clock: Clock, bus: CanBus, name: str, node_id: int, description: Description) -> None:
        self.clock = clock
        self.name = name
        self.node_id = node_id
        self.dictionary = Dictionary(description)
        self.state = NmtState.INITIALISING
        self.powered = False
        self._bus = bus
        self._emergencies = Emergencies(self.dictionary, self._send_communicating)
        self._heartbeat = HeartbeatProducer(clock, self.dictionary, self._send_heartbeat)
        self._consumer = HeartbeatConsumer(clock, self.dictionary, self._heartbeat_lost)
        self._storage = Storage(self.dictionary)
        self._tpdos: list[pdo.Tpdo] = []
        self._rpdos: list[pdo.Rpdo] = []
        self._handlers: dict[int, Callable[[Frame], None]] = {}
        self._boots = 0
        pdo.guard_configuration(self.dictionary, self._configure_soon)
        self._reconfigure_on_write()

    # -- power -----------------------------------------------------------------------------------------

    def power_on(self, boot_ns: int = BOOT_TIME_NS) -> None:
        """Switch the device on; it says so on the bus when it has booted."""
        self.powered = True
        self._bus.attach(self, self._receive)
        self._boot(EVERYTHING, boot_ns)

    def power_off(self) -> None:
        """Switch the device off, without a word on the bus."""
        self.powered = False
        self._boots += 1
        self._bus.detach(self)
        self._silence()
        self.state = NmtState.INITIALISING
        self._on_reset()

    def _boot(self, objects: range, boot_ns: int) -> None:
        self._silence()
        self._enter(NmtState.INITIALISING)
        self._storage.restore(objects)
        self._emergencies.reset()
        if objects is EVERYTHING:
            self._on_reset()
        self._boots += 1
        boot = self._boots
        self.clock.after(boot_ns, lambda: self._booted() if boot == self._boots else None)

    def _booted(self) -> None:
        self._configure()
        self._send_heartbeat()
        self._enter(NmtState.PRE_OPERATIONAL)
        self._heartbeat.start()
        self._on_booted()

    def _silence(self) -> None:
        self._heartbeat.stop()
        self._consumer.stop()
        for tpdo in self._tpdos:
            tpdo.stop()
        self._handlers = {}

    # -- what a profile adds ---------------------------------------------------------------------------

    def _on_reset(self) -> None:
        """Everything begins anew."""

    def _on_booted(self) -> None:
        """The device has said that it is there."""

    def _on_state(self, before: NmtState) -> None:
        """The NMT state has changed."""

    def _on_sync(self) -> None:
        """A SYNC came: RPDOs have taken effect, TPDOs are not yet sampled."""

    def _on_heartbeat(self, node_id: int, state: int) -> None:
        """Another node has booted (`state` 0) or shown its heartbeat."""

    def _on_communication_lost(self) -> None:
        """A watched heartbeat stayed away."""

    # -- the bus ---------------------------------------------------------------------------------------

    def send(self, cob_id: int, data: bytes) -> None:
        self._bus.send(Frame(cob_id, data), self)

    def _send_communicating(self, cob_id: int, data: bytes) -> None:
        if self.state in nmt.COMMUNICATING:
            self.send(cob_id, data)

    def _send_heartbeat(self) -> None:
        self.send(nmt.HEARTBEAT_BASE + self.node_id, bytes([self.state]))

    def _receive(self, frame: Frame, _sender: object) -> None:
        handler = self._handlers.get(frame.cob_id)
        if handler is not None and not frame.extended:
            handler(frame)

    def object_changed(self, key: Key) -> None:
        """Tell event-driven PDOs that an object they carry has another value."""
        if self.state is NmtState.OPERATIONAL:
            for tpdo in self._tpdos:
                tpdo.changed(key)

    def bus_off(self) -> None:
        """The device's CAN controller has left the bus: it acts as 1029h and its profile say."""
        key = COMMUNICATION_ERROR_BEHAVIOUR
        behaviour = self.dictionary[key].number() if key in self.dictionary else 0
        if self.state is NmtState.OPERATIONAL and behaviour in nmt.STATE_AFTER_ERROR:
            self._enter(nmt.STATE_AFTER_ERROR[behaviour])
        self._on_communication_lost()

    def emergency(self, code: int, vendor: bytes = b"") -> None:
        self._emergencies.occurred(code, vendor)

    def emergency_over(self) -> None:
        self._emergencies.end_all()

    # -- configuration from the dictionary ---------------------------------------------------------------

    def _reconfigure_on_write(self) -> None:
        """SYNC and SDO channels listen where their objects say, from the moment that is written."""
        servers = [self.dictionary.members(index)[1:3] for index in self.dictionary.indices(*SDO_SERVERS)]
        for entry in (self.dictionary[SYNC], *(entry for server in servers for entry in server)):
            entry.on_write = lambda _: self._configure_soon()

    def _configure_soon(self) -> None:
        """Configure when the write that asked for it has been taken into the dictionary."""
        self.clock.at(self.clock.now_ns, self._configure)

    def _configure(self) -> None:
        for tpdo in self._tpdos:
            tpdo.stop()
        count = pdo.PDO_COUNT - 1
        tpdo_indices = self.dictionary.indices(pdo.TPDO_COMMUNICATION, pdo.TPDO_COMMUNICATION + count)
        rpdo_indices = self.dictionary.indices(pdo.RPDO_COMMUNICATION, pdo.RPDO_COMMUNICATION + count)
        self._tpdos = [
            pdo.Tpdo(self.clock, self.dictionary, index - pdo.TPDO_COMMUNICATION, self.send)
            for index in tpdo_indices
        ]
        self._rpdos = [
            pdo.Rpdo(self.dictionary, index - pdo.RPDO_COMMUNICATION, self._rpdo_too_short)
            for index in rpdo_indices
        ]
        self._handlers = dict(self._all_handlers())
        if self.state is NmtState.OPERATIONAL:
            self._start_tpdos()

    def _all_handlers(self) -> list[tuple[int, Callable[[Frame], None]]]:
        heartbeats = [nmt.HEARTBEAT_BASE + node for node in range(1, 128) if node != self.node_id]
        return [
            *((cob_id, self._heartbeat_received) for cob_id in heartbeats),
            *((rpdo.cob_id, self._rpdo_handler(rpdo)) for rpdo in self._rpdos if rpdo.valid),
            *((tpdo.cob_id, self._remote_handler(tpdo)) for tpdo in self._tpdos if tpdo.valid),
            *self._sdo_handlers(),
            (self.dictionary[SYNC].number() & _COB_ID, self._sync_received),
            (nmt.NMT_COB_ID, self._nmt_received),
        ]

    def _sdo_handlers(self) -> list[tuple[int, Callable[[Frame], None]]]:
        handlers = []
        for index in self.dictionary.indices(*SDO_SERVERS):
            request, response = (self.dictionary[index, number].number() for number in (1, 2))
            if not (request | response) & _INVALID:
                handlers.append((request & _COB_ID, self._sdo_handler(response & _COB_ID)))
        return handlers

    def _sdo_handler(self, response_cob_id: int) -> Callable[[Frame], None]:
        server = SdoServer(self.dictionary)

        def handle(frame: Frame) -> None:
            if self.state in nmt.COMMUNICATING and not frame.remote:
                response = server.respond(frame.data)
                if response is not None:
                    self.send(response_cob_id, response)

        return handle

    def _rpdo_handler(self, rpdo: pdo.Rpdo) -> Callable[[Frame], None]:
        def handle(frame: Frame) -> None:
            if self.state is NmtState.OPERATIONAL and not frame.remote:
                rpdo.receive(frame.data)

        return handle

    def _remote_handler(self, tpdo: pdo.Tpdo) -> Callable[[Frame], None]:
        def handle(frame: Frame) -> None:
            if self.state is NmtState.OPERATIONAL and frame.remote:
                tpdo.requested()

        return handle

    # -- services --------------------------------------------------------------------------------------

    def _nmt_received(self, frame: Frame) -> None:
        if len(frame.data) < 2 or frame.data[1] not in (0, self.node_id):
            return
        service = frame.data[0]
        if service in nmt.STATE_AFTER:
            self._enter(nmt.STATE_AFTER[service])
        elif service == NmtService.RESET_NODE:
            self._boot(EVERYTHING, BOOT_TIME_NS)
        elif service == NmtService.RESET_COMMUNICATION:
            self._boot(COMMUNICATION, BOOT_TIME_NS)

    def _enter(self, state: NmtState) -> None:
        before, self.state = self.state, state
        if state is before:
            return
        for tpdo in self._tpdos:
            tpdo.stop()
        if state is NmtState.OPERATIONAL:
            self._start_tpdos()
        self._on_state(before)

    def _start_tpdos(self) -> None:
        for tpdo in self._tpdos:
            tpdo.start()

    def _sync_received(self, _frame: Frame) -> None:
        self.synchronise()

    def synchronise(self) -> None:
        """What a SYNC does: received PDOs take effect, then those to send are sampled."""
        operational = self.state is NmtState.OPERATIONAL
        if operational:
            for rpdo in self._rpdos:
                rpdo.synchronise()
        if self.state in nmt.COMMUNICATING:
            self._on_sync()
        if operational:
            for tpdo in self._tpdos:
                tpdo.synchronise()

    def _heartbeat_received(self, frame: Frame) -> None:
        node_id = frame.cob_id - nmt.HEARTBEAT_BASE
        self._consumer.received(node_id)
        if len(frame.data) == 1:
            self._on_heartbeat(node_id, frame.data[0])

    def _heartbeat_lost(self, node_id: int) -> None:
        self.emergency(EMCY_HEARTBEAT_LOST, bytes([node_id]))
        self._on_communication_lost()

    def _rpdo_too_short(self) -> None:
        self.emergency(EMCY_PDO_TOO_SHORT)
        self._emergencies.ended(EMCY_PDO_TOO_SHORT)
