"""A CANopen node that speaks from CiA 301, with quirks that real ones have; knows nothing of the drivers."""

import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType

import can

Object = tuple[int, int]


@dataclass
class FakeNode:
    """An SDO server and whatever frames it is told to send, on its own python-can bus."""

    channel: str
    node_id: int
    objects: dict[Object, bytes] = field(default_factory=dict)
    aborts: dict[Object, int] = field(default_factory=dict)  # answered instead
    silent: bool = False  # hears, answers nothing
    repeat_replies: int = 1  # how often each answer is sent
    deaf_to: set[Object] = field(default_factory=set)  # requests about these are not answered
    interface: str = "virtual"
    delay_s: float = 0.0  # from a request to its answer
    on_request: Callable[[bytes], None] = lambda request: None
    on_write: Callable[[int, int, bytes], None] = lambda index, subindex, data: None

    def __post_init__(self) -> None:
        self.requests: list[bytes] = []
        self.writes: list[tuple[int, int, bytes]] = []
        self.seen: list[tuple[int, bytes]] = []
        self._due: deque[tuple[float, bytes]] = deque()  # answers, and when
        self._download: tuple[int, int, bytearray] | None = None
        self._upload = b""

    def __enter__(self) -> "FakeNode":
        self.bus = can.Bus(channel=self.channel, interface=self.interface)
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="fake node")
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stopping.set()
        self._thread.join()
        self.bus.shutdown()

    def send(self, can_id: int, data: bytes) -> None:
        self.send_message(can_id, data, extended=False)

    def send_message(self, can_id: int, data: bytes, *, extended: bool) -> None:
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=extended))

    def boot_up(self) -> None:
        self.send(0x700 + self.node_id, b"\x00")

    def heartbeat(self, state: int = 0x05) -> None:
        self.send(0x700 + self.node_id, bytes([state]))

    def emcy(self, code: int, register: int = 0, vendor_data: bytes = bytes(5)) -> None:
        self.send(0x080 + self.node_id, struct.pack("<HB", code, register) + vendor_data)

    def _serve(self) -> None:
        while not self._stopping.is_set():
            message = self.bus.recv(self._patience_s())
            if message is not None:
                self.seen.append((message.arbitration_id, bytes(message.data)))
                if message.arbitration_id == 0x600 + self.node_id:
                    self._answer(bytes(message.data))
            while self._due and self._due[0][0] <= time.monotonic():
                self.send(0x580 + self.node_id, self._due.popleft()[1])

    def _patience_s(self) -> float:
        return min(0.02, max(0.0, self._due[0][0] - time.monotonic())) if self._due else 0.02

    def _answer(self, request: bytes) -> None:
        self.requests.append(request)
        self.on_request(request)
        command, index, subindex = struct.unpack_from("<BHB", request)
        if self.silent or command == 0x80 or ((index, subindex) in self.deaf_to and command >> 5 in (1, 2)):
            return
        reply = self._reply(command, index, subindex, request)
        self._due.extend([(time.monotonic() + self.delay_s, reply)] * self.repeat_replies)

    def _reply(self, command: int, index: int, subindex: int, request: bytes) -> bytes:
        specifier = command >> 5
        if specifier in (1, 2) and (index, subindex) in self.aborts:
            return struct.pack("<BHBI", 0x80, index, subindex, self.aborts[index, subindex])
        if specifier == 2:
            return self._initiate_upload(index, subindex)
        if specifier == 3:
            return self._upload_segment(command & 0x10)
        if specifier == 1:
            return self._initiate_download(command, index, subindex, request)
        return self._download_segment(command, request)

    def _initiate_upload(self, index: int, subindex: int) -> bytes:
        data = self.objects.get((index, subindex))
        if data is None:
            return struct.pack("<BHBI", 0x80, index, subindex, 0x06020000)
        if len(data) <= 4:
            return struct.pack("<BHB", 0x43 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
        self._upload = data
        return struct.pack("<BHBI", 0x41, index, subindex, len(data))

    def _upload_segment(self, toggle: int) -> bytes:
        segment, self._upload = self._upload[:7], self._upload[7:]
        last = not self._upload
        return bytes([toggle | (7 - len(segment)) << 1 | last]) + segment.ljust(7, b"\0")

    def _initiate_download(self, command: int, index: int, subindex: int, request: bytes) -> bytes:
        if command & 0x02:
            self._write(index, subindex, request[4 : 8 - (command >> 2 & 3)])
        else:
            self._download = (index, subindex, bytearray())
        return struct.pack("<BHB", 0x60, index, subindex) + bytes(4)

    def _download_segment(self, command: int, request: bytes) -> bytes:
        assert self._download is not None
        index, subindex, data = self._download
        data += request[1 : 8 - (command >> 1 & 7)]
        if command & 1:
            self._write(index, subindex, bytes(data))
        return bytes([0x20 | command & 0x10]) + bytes(7)

    def _write(self, index: int, subindex: int, data: bytes) -> None:
        self.writes.append((index, subindex, data))
        self.objects[index, subindex] = data
        self.on_write(index, subindex, data)
