"""Eight `canopen.LocalNode`s as drives, the plain way to simulate some, for the simulator's benchmark.

On each SYNC every node takes its last set-point (RPDO) for its position and sends statusword and position
(TPDO). No motion, no states, no bit rate, no sensors, no door to other processes. The master's SYNC and
set-points come from the same process, over python-can's virtual bus.

`python -m tests.bench._local_nodes SYNC_HZ SECONDS` says its processor time (s) and the SYNCs it answered.
"""

import json
import sys
import threading
import time

import can
import canopen

import eds

DRIVES = 8
TARGET_POSITION, TARGET_BYTES = 0x607A, 4


class Drive:
    """One node, moved by its set-points at once."""

    def __init__(self, network: canopen.Network, node_id: int) -> None:
        node = canopen.LocalNode(
            node_id, eds.load(eds.locate("joint_drive.eds", None), node_id).object_dictionary
        )
        network.add_node(node)
        node.tpdo.read(from_od=True)  # type: ignore[no-untyped-call]
        node.rpdo.read(from_od=True)  # type: ignore[no-untyped-call]
        self.answered = 0
        self._tpdo = node.tpdo[1]
        self._statusword, self._position = self._tpdo
        self._target = node.rpdo[1][TARGET_POSITION]
        network.subscribe(0x80, self._on_sync)

    def _on_sync(self, _cob_id: int, _data: bytearray, _stamp: float) -> None:
        self._position.raw = self._target.raw
        self._statusword.raw = 0x1637
        self._tpdo.transmit()
        self.answered += 1


def main() -> None:
    sync_hz, seconds = float(sys.argv[1]), float(sys.argv[2])
    network = canopen.Network(can.Bus("local nodes", "virtual"))
    network.connect()
    drives = [Drive(network, node_id) for node_id in range(1, DRIVES + 1)]
    with can.Bus("local nodes", "virtual") as master:
        began, cpu = time.monotonic(), time.process_time()
        for number in range(round(sync_hz * seconds)):
            time.sleep(max(0.0, began + number / sync_hz - time.monotonic()))
            master.send(can.Message(arbitration_id=0x80, is_extended_id=False))
            for node_id in range(1, DRIVES + 1):
                data = b"\x0f\x00\x08" + number.to_bytes(TARGET_BYTES, "little")
                master.send(can.Message(arbitration_id=0x200 + node_id, data=data, is_extended_id=False))
            while master.recv(0) is not None:
                pass
        threading.Event().wait(0.2)
        used = time.process_time() - cpu
    network.disconnect()
    sys.stdout.write(json.dumps({"cpu_s": used, "syncs": min(drive.answered for drive in drives)}) + "\n")


if __name__ == "__main__":
    main()
