"""A bridge to a python-can `virtual` channel: programs in the same process join the simulated bus."""

from copy import copy
from typing import Any

import can

from hil_sim.bus.can_bus import CanBus, Frame
from hil_sim.clock import MILLISECOND_NS

_POLL_NS = MILLISECOND_NS  # a virtual channel cannot be waited for together with anything else


class _Message(can.Message):
    """python-can copies it for each receiver, and its data the long way, of which nobody changes any."""

    __slots__ = ()

    def __deepcopy__(self, memo: dict[int, Any] | None) -> can.Message:
        return copy(self)


class VirtualBridge:
    """Carries frames between the simulated bus and the `virtual` channel named `channel`."""

    def __init__(self, bus: CanBus, channel: str) -> None:
        self._bus = bus
        self._outside = can.Bus(interface="virtual", channel=channel, preserve_timestamps=True)
        self._polling = bus.clock.every(_POLL_NS, self._poll)
        bus.attach(self, self._receive, self._receive_error)

    def close(self) -> None:
        self._polling.cancel()
        self._bus.detach(self)
        self._outside.shutdown()

    def _poll(self) -> None:
        while (message := self._outside.recv(timeout=0)) is not None:
            if not message.is_error_frame:
                data = b"" if message.is_remote_frame else bytes(message.data)
                frame = Frame(message.arbitration_id, data, message.is_extended_id, message.is_remote_frame)
                self._bus.send(frame, self)

    def _receive(self, frame: Frame, _sender: object) -> None:
        self._outside.send(
            _Message(
                arbitration_id=frame.cob_id,
                data=frame.data,
                is_extended_id=frame.extended,
                is_remote_frame=frame.remote,
                timestamp=self._bus.clock.now_s,
            )
        )

    def _receive_error(self, error_class: int) -> None:
        self._outside.send(
            _Message(
                arbitration_id=error_class,
                data=bytes(8),
                is_error_frame=True,
                timestamp=self._bus.clock.now_s,
            )
        )
