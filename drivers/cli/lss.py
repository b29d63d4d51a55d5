"""`gwrms lss`: devices without a node id found, node ids and bit rates given (CiA 305)."""

import argparse
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import msgspec

from drivers.bus.bus import CanBus
from drivers.bus.settings import CanSettings
from drivers.cli import bit_rate
from drivers.cli.buses import named
from drivers.errors import NotPermitted, SettingsError
from drivers.lss.change import Device, give_bitrate, give_node_id, inquire
from drivers.lss.fastscan import unconfigured
from drivers.lss.master import BITRATES, SCAN_S, UNCONFIGURED, Identity, LssMaster
from drivers.lss.preconditions import BusSurvey, identity_of, is_taken, listen

MORE = """\
examples:
  gwrms lss find can0                          devices that have no node id yet, all of them
  gwrms lss inquire can0 5                     what node 5 says to LSS
  gwrms lss set can0 new --node-id 5           the one device without a node id becomes node 5
  gwrms lss set can0 5 --node-id 6             node 5 becomes node 6
  gwrms lss set can0 0x8A:0x21:0x10000:4711 --node-id 6 --new-bitrate 500000

DEVICE is a node id (its identity is read by SDO), an identity VENDOR:PRODUCT:REVISION:SERIAL as `find` shows
it, `new` for the only one without a node id, or `only` for the only device on the bus.

The command listens to the bus first. If a device is operational, or the bus has a master, nothing is sent.
Before any change the command shows the plan and asks. A node id is stored and booted with, then queried
again. A bit rate is stored, and takes effect when the device is next switched on; with --activate at once, if
the device is alone on a bus whose interface is opened with a bit rate (USB adapters; not SocketCAN).
"""
WAIT_S = 3.0  # longer than most heartbeats
AGAIN_S = 1.0  # after the question
NODE_IDS = range(1, 128)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms lss",
        description="Find CANopen devices without a node id; set node ids and bit rates (CiA 305).",
        epilog=MORE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("action", choices=tuple(ACTIONS), help="what to do")
    parser.add_argument("bus", metavar="BUS", help="can0, INTERFACE:CHANNEL, or a robot's file with one bus")
    parser.add_argument("device", metavar="DEVICE", nargs="?", help="the device; not for find")
    parser.add_argument("--node-id", type=int, metavar="N", help="set: the new node id")
    parser.add_argument(
        "--new-bitrate",
        type=int,
        choices=tuple(BITRATES),
        metavar="N",
        help="set: the bit rate to store",
    )
    parser.add_argument(
        "--activate", action="store_true", help="set: apply the bit rate at once, and look for the device"
    )
    parser.add_argument("--no-store", action="store_true", help="set: keep the node id until power-off only")
    parser.add_argument("--bitrate", type=int, help="present bit/s of the bus, for interfaces that need one")
    parser.add_argument("--seconds", type=float, default=WAIT_S, help="how long to listen first (default 3)")
    parser.add_argument(
        "--timeout",
        type=float,
        default=SCAN_S,
        metavar="S",
        help="find: timeout of each answer (default 0.05)",
    )
    parser.add_argument("--anyway", action="store_true", help="go on although the bus is in use")
    parser.add_argument("--yes", action="store_true", help="do not ask for confirmation")
    parser.add_argument("--json", action="store_true", help="print one JSON line, for programs")
    return parser


def main(arguments: Sequence[str]) -> int:
    """Do one thing on one bus; returns the exit status.

    Raises:
        DriverError: it was refused, not answered, or not what was asked for.

    """
    parser = _parser()
    options = parser.parse_args(arguments)
    if wrong := _misused(options):
        parser.error(wrong)
    buses = list(named([options.bus], options.bitrate))
    if len(buses) != 1:
        parser.error(f"{options.bus} has {len(buses)} buses: name the interface of one")
    name, settings = buses[0]
    with bit_rate.opened(name, settings) as bus:
        wait = threading.Event().wait
        heard = listen(bus, options.seconds, wait)
        if not options.anyway:
            heard.refuse()
        with LssMaster(bus, scan_s=options.timeout) as master:
            task = _Task(bus, settings, master, heard, options, wait)
            status = ACTIONS[options.action](task)
    if task.activated is not None:
        found = bit_rate.look_again(name, settings, options.new_bitrate, task.activated, wait)
        task.say(f"{name}: at {options.new_bitrate} bit/s it says: {_words(found)}")
    return status


def _misused(options: argparse.Namespace) -> str | None:
    if not 0 < options.seconds <= 600:
        return f"--seconds {options.seconds:g} is outside 0 to 600"
    if not 0.001 <= options.timeout <= 10:
        return f"--timeout {options.timeout:g} is outside 0.001 to 10"
    if (options.device is None) is (options.action != "find"):
        return (
            "name the device: a node id, an identity, new or only"
            if options.device is None
            else "find: no DEVICE"
        )
    if options.action != "set":
        return "--node-id and --new-bitrate are for set" if options.node_id or options.new_bitrate else None
    if options.node_id is None and options.new_bitrate is None:
        return "say what it is to have: --node-id, --new-bitrate, or both"
    if options.node_id is not None and options.node_id not in NODE_IDS:
        return f"--node-id {options.node_id} is outside 1 to 127"
    if options.activate and options.new_bitrate is None:
        return "--activate is for --new-bitrate"
    if options.no_store and options.new_bitrate is not None:
        return "a bit rate that is not stored is lost before it counts: without --no-store"
    return None


class _Task:
    """Context of one call."""

    def __init__(
        self,
        bus: CanBus,
        settings: CanSettings,
        master: LssMaster,
        heard: BusSurvey,
        options: argparse.Namespace,
        wait: Callable[[float], object],
    ) -> None:
        self.bus, self.settings, self.master, self.heard = bus, settings, master, heard
        self.options, self.wait = options, wait
        self.activated: Device | None = None  # which is at another bit rate now

    def say(self, text: str) -> None:
        """Tell people: on stderr if stdout is for machines."""
        stream = sys.stderr if self.options.json else sys.stdout
        stream.write(text + "\n")
        stream.flush()

    def answer(self, found: Any) -> None:
        if self.options.json:
            sys.stdout.write(msgspec.json.encode(found).decode() + "\n")

    def device(self) -> Device:
        """Return the device that is meant, as it is now."""
        text = self.options.device
        if text == "new":
            found = unconfigured(self.master)
            if len(found) != 1:
                known = "".join(f"\n  {identity}" for identity in found)
                raise NotPermitted(
                    f"{self.bus.name}: {len(found) or 'no'} devices have no node id; "
                    + (f"say which:{known}" if found else "is it switched on, does it have one already?")
                )
            return Device(found[0], UNCONFIGURED)
        if text == "only":
            if len(self.heard.nodes) > 1:  # they would all be asked at once, in frames that look like one
                nodes = ", ".join(map(str, self.heard.nodes))
                raise NotPermitted(f"{self.bus.name}: nodes {nodes} are on the bus: say which")
            return inquire(self.master, None)
        if text.isdecimal():
            if int(text) not in NODE_IDS:
                raise SettingsError(f"node id {text} is outside 1 to 127")
            return inquire(self.master, identity_of(self.bus, int(text)))
        return inquire(self.master, Identity.parse(text))


def _find(task: _Task) -> int:
    task.say(f"{task.bus.name}: searching; each device takes some seconds")
    found = unconfigured(task.master)
    for identity in found:
        task.say(f"  {identity}   without a node id")
    if not found:
        task.say("  nobody: every device that has LSS has a node id (gwrms scan finds those)")
    task.answer({"unconfigured": [_as_json(Device(identity, UNCONFIGURED)) for identity in found]})
    return 0


def _inquire(task: _Task) -> int:
    device = task.device()
    task.say(f"{task.bus.name}: {_words(device)}")
    task.answer(_as_json(device))
    return 0


def _set(task: _Task) -> int:
    options, device = task.options, task.device()
    node_id, bitrate = options.node_id, options.new_bitrate
    if (
        node_id is not None
        and node_id != device.node_id
        and is_taken(task.bus, node_id, task.heard, task.wait)
    ):
        raise NotPermitted(
            f"{task.bus.name}: another device has node id {node_id} already; nothing was changed"
        )
    if options.activate:
        bit_rate.check(task.bus.name, task.settings, bitrate, set(task.heard.nodes) - {device.node_id})
    task.say(f"{task.bus.name}: {_words(device)}")
    task.say("\n".join(_plan(device, node_id, bitrate, stored=not options.no_store)))
    if not _agreed(task):
        task.say("nothing was changed")
        return 1
    if not (options.yes or options.anyway):  # it may have taken a while
        listen(task.bus, min(options.seconds, AGAIN_S), task.wait).refuse()
    if node_id is not None:
        device = give_node_id(task.bus, task.master, device, node_id, store=not options.no_store)
        task.say(f"{task.bus.name}: it has booted, and says: {_words(device)}")
    if bitrate is not None:
        delay_ms = bit_rate.SWITCH_MS if options.activate else None
        give_bitrate(task.master, device, bitrate, task.settings.bitrate, delay_ms)
        after = "It changes to it now" if options.activate else bit_rate.next_steps(task.settings, bitrate)
        task.say(f"{task.bus.name}: {bitrate} bit/s stored. {after}")
        task.activated = device if options.activate else None
    task.answer(_as_json(device) | {"stored": not options.no_store, "stored_bitrate": bitrate})
    return 0


def _plan(device: Device, node_id: int | None, bitrate: int | None, *, stored: bool) -> Iterator[str]:
    """Yield the plan for the person, line by line."""
    if node_id is not None:
        keeps = "stores that" if stored else "forgets that when it is switched off"
        yield f"  it becomes node {node_id}, and {keeps}"
        if device.configured and node_id != device.node_id:
            yield (
                f"  its communication is reset (NMT to node {device.node_id} alone): PDOs and heartbeat are "
                "then as it has stored them"
            )
        yield f"  it boots as node {node_id}; who knew it by another id, as robot.toml does, must be told"
    if bitrate is not None:
        yield f"  it stores {bitrate} bit/s: switched on next, it is heard at that rate and at no other"


def _agreed(task: _Task) -> bool:
    if task.options.yes:
        return True
    if not sys.stdin.isatty():
        raise NotPermitted("there is no terminal to ask on, and nothing was changed; say --yes to go on")
    task.say("go on? [y/N]")
    return sys.stdin.readline().strip().lower() in ("y", "yes")


def _words(device: Device) -> str:
    has = f"node {device.node_id}" if device.configured else "without a node id"
    return f"{device.identity}, {has}"


def _as_json(device: Device) -> dict[str, Any]:
    return {
        "identity": str(device.identity),
        "vendor_id": device.identity.vendor_id,
        "product_code": device.identity.product_code,
        "revision": device.identity.revision,
        "serial_number": device.identity.serial_number,
        "node_id": device.node_id if device.configured else None,
    }


ACTIONS: dict[str, Callable[[_Task], int]] = {"find": _find, "inquire": _inquire, "set": _set}
