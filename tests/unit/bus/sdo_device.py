"""A device of which only the SDO server is played, and what its worker is asked for."""

import threading
from concurrent.futures import Future

from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sdo.worker import SdoWorker
from tests.unit.bus.direct import Direct


class Device:
    """Answers uploads and downloads of four bytes; some objects stay unanswered."""

    def __init__(self) -> None:
        self.requests: list[bytes] = []
        self.deaf_to: dict[int, int] = {}  # index: how many requests stay unanswered
        self.asked = threading.Event()
        self.channel = SdoChannel("node 1", Direct(self.hear), timeout_s=0.2)

    def hear(self, request: bytes) -> None:
        self.requests.append(request)
        self.asked.set()
        index = int.from_bytes(request[1:3], "little")
        if request[0] == 0x80:
            return
        if self.deaf_to.get(index, 0) > 0:
            self.deaf_to[index] -= 1
            return
        reply = (
            b"\x43" + request[1:4] + request[1:3] + b"\0\0" if request[0] == 0x40 else b"\x60" + request[1:4]
        )
        self.channel.on_response(0, reply.ljust(8, b"\0"))

    def commands(self) -> list[str]:
        return [f"{request[0]:02X} {int.from_bytes(request[1:3], 'little'):04X}" for request in self.requests]


def upload(worker: SdoWorker, index: int, *, urgent: bool = False) -> Future[bytes]:
    return worker.submit(lambda sdo: sdo.upload(index, 0), urgent=urgent)


STOP = bytes.fromhex("2B 40 60 00 02 00 00 00")


def stop(worker: SdoWorker, *, wake: bool = True) -> Future[None]:
    def job(sdo: SdoChannel) -> None:
        sdo.download(0x6040, 0, b"\x02\x00")

    return worker.submit(job, urgent=True, ahead=STOP, wake=wake)
