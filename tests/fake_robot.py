"""A robot's gateway as the wire contract describes it: json and asyncio alone, nothing of ours imported.

It walks: the joints swing, the feet alternate, the parameters can be written. Tests can break it: cut its
links, mute it, close its port, give a method another answer.
"""

import asyncio
import fnmatch
import json
import math
import socket
import threading
import time
from collections.abc import Callable, Coroutine
from typing import Any, Self

JOINTS = ("left_hip", "left_knee", "left_ankle", "right_hip", "right_knee", "right_ankle")
FEET = ("left_insole", "right_insole")
STATES = {0: "NOT READY TO SWITCH ON", 5: "OPERATION ENABLED", 7: "FAULT"}

Params = dict[str, Any]
Answer = Callable[[Params], Any]


class Refusal(Exception):
    """A JSON-RPC error that a fake answer wants to give."""

    def __init__(self, code: int, message: str, **data: Any) -> None:
        super().__init__(message)
        self.error = {"code": code, "message": message, "data": data}


class FakeRobot:
    """The gateway of a simulated walker; use it as a context manager, reach it at `address`."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, Params]] = []
        self.boot_id = "boot-1"
        self.protocol = 1
        self.version = "0.1.0"
        self.mute = False
        self.lost: set[str] = set()
        self.frozen = False
        self.parameters = {"gait.step_length": 0.40, "gait.cycle_time": 1.1, "left_knee.max_torque": 20.0}
        self.seq_step = 1
        self.overrides: dict[str, Answer] = {}
        self.port = 0
        self._streams = 0
        self._leased = False
        self._trial: dict[str, float] = {}  # what the trial reverts to
        self._resource_asked = False
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="fake-robot")
        self._acceptor: asyncio.Task[None] | None = None
        self._last_guest: object = None
        self._sessions: dict[asyncio.Task[None], asyncio.StreamWriter] = {}
        self._methods: dict[str, Answer] = {
            "hello": self._hello,
            "robot.describe": lambda params: self.describe(),
            "clock.read": lambda params: {
                "monotonic_ns": time.monotonic_ns(),
                "utc_ns": time.time_ns(),
                "boot_id": self.boot_id,
            },
            "resource.snapshot": self._resource,
            "component.snapshot": self._component,
            "status.snapshot": self._component,
            "stream.stop": lambda params: {},
            "control.acquire": self._acquire,
            "control.release": self._release,
            "parameter.list": self._read,
            "parameter.read": self._read,
            "parameter.write": self._write,
            "parameter.confirm": self._confirm,
            "parameter.revert": self._revert,
            "robot.stop": lambda params: {"drives": dict.fromkeys(JOINTS, "confirmed"), "held": True},
        }

    # --- what tests do to it

    def __enter__(self) -> Self:
        self._thread.start()
        self.listen()
        return self

    def __exit__(self, *exc: object) -> None:
        self.refuse()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    def listen(self) -> None:
        """Open the port (the same one again after `refuse`)."""
        self._run(self._listen())

    def refuse(self) -> None:
        """Close the port and cut every link."""
        self._run(self._close())

    def cut(self) -> None:
        """Cut every link and go on listening."""
        self._run(self._cut())

    def push(self, line: bytes) -> None:
        """Send raw bytes to every client."""
        for writer in list(self._sessions.values()):
            self._loop.call_soon_threadsafe(writer.write, line)

    def called(self, method: str) -> list[Params]:
        """The parameters of every call of `method`, oldest first."""
        return [params for name, params in list(self.calls) if name == method]

    def _run(self, work: Coroutine[Any, Any, None]) -> None:
        asyncio.run_coroutine_threadsafe(work, self._loop).result(10)

    # --- the server

    # asyncio's own server loses sockets that it has just accepted when it is closed; this one does not.
    async def _listen(self) -> None:
        listener = socket.create_server(("127.0.0.1", self.port))
        listener.setblocking(False)
        self.port = listener.getsockname()[1]
        self._acceptor = asyncio.create_task(self._accept(listener))

    async def _accept(self, listener: socket.socket) -> None:
        with listener:
            while True:
                sock, peer = await self._loop.sock_accept(listener)
                if peer == self._last_guest:
                    sock.close()
                    return
                reader, writer = await asyncio.open_connection(sock=sock)
                task = asyncio.create_task(self._serve(reader, writer))
                self._sessions[task] = writer

    async def _close(self) -> None:
        if self._acceptor is not None:
            with socket.socket() as guest:
                guest.bind(("127.0.0.1", 0))
                self._last_guest = guest.getsockname()
                guest.connect(("127.0.0.1", self.port))
                await self._acceptor
            self._acceptor = None
        await self._cut()

    async def _cut(self) -> None:
        tasks = list(self._sessions)
        for task, writer in list(self._sessions.items()):
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.sleep(0)  # the transports close their sockets in the loop's next turn

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        streams: list[asyncio.Task[None]] = []
        try:
            while line := await reader.readline():
                request = json.loads(line)
                params = request.get("params", {})
                self.calls.append((request["method"], params))
                if self.mute:
                    continue
                if request["method"] == "stream.start" and "stream.start" not in self.overrides:
                    self._streams += 1
                    self._send(writer, {"id": request["id"], "result": {"stream": self._streams}})
                    streams.append(asyncio.create_task(self._stream(writer, self._streams, params)))
                    continue
                self._send(writer, {"id": request["id"], **self._answer(request["method"], params)})
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            for stream in streams:
                stream.cancel()
            await asyncio.gather(*streams, return_exceptions=True)
            writer.close()
            self._sessions = {task: known for task, known in self._sessions.items() if known is not writer}

    def _answer(self, method: str, params: Params) -> Params:
        answer = self.overrides.get(method) or self._methods.get(method)
        if answer is None:
            return {"error": {"code": -32601, "message": f"there is no method {method!r}"}}
        try:
            return {"result": answer(params)}
        except Refusal as refusal:
            return {"error": refusal.error}

    @staticmethod
    def _send(writer: asyncio.StreamWriter, message: Params) -> None:
        writer.write(json.dumps({"jsonrpc": "2.0", **message}).encode() + b"\n")

    async def _stream(self, writer: asyncio.StreamWriter, number: int, params: Params) -> None:
        columns = [name for name in self.values() if self._wanted(name, params.get("channels"))]
        columns = columns if {"component", "status"} & set(params["modules"]) else []
        seq = 0
        while True:
            await asyncio.sleep(1.0 / (params["rate_hz"] or 100))
            if self.mute or self.frozen:
                continue
            values = self.values()
            row = {name: [values[name]] for name in columns}
            if "resource" in params["modules"]:
                row |= {"resource.cpu_percent": [12.5], "resource.memory_percent": [40.0]}
            data = {
                "stream": number,
                "seq": seq,
                "dropped": 0,
                "stamp_ns": [time.monotonic_ns()],
                "columns": row,
            }
            seq += self.seq_step
            self._send(writer, {"method": "stream.data", "params": data})

    # --- the robot

    def values(self) -> dict[str, float | None]:
        """Every channel now: a walk at one stride a second."""
        phase = 2 * math.pi * time.monotonic()
        values: dict[str, float | None] = {}
        for joint in JOINTS:
            side = 0.0 if joint.startswith("left") else math.pi
            values[f"{joint}.position"] = self.parameters["gait.step_length"] * math.sin(phase + side)
            values[f"{joint}.state"] = 5
        values["left_insole.force"] = 700.0 * max(0.0, math.sin(phase))
        values["right_insole.force"] = 700.0 * max(0.0, -math.sin(phase))
        values["trunk.tilt_forward"] = 0.05 * math.sin(2 * phase)
        values["trunk.tilt_side"] = 0.02 * math.sin(phase)
        for name in values:
            if name.partition(".")[0] in self.lost:
                values[name] = None
        return values

    def describe(self) -> Params:
        units = {"position": "rad", "force": "N", "tilt_forward": "rad", "tilt_side": "rad", "state": ""}
        channels = []
        for name in self.values():
            component, _, quantity = name.partition(".")
            channel: Params = {
                "name": name,
                "component": component,
                "quantity": quantity,
                "unit": units[quantity],
            }
            if quantity == "state":
                channel["enum"] = {str(number): word for number, word in STATES.items()}
            channels.append(channel)
        channels += [
            {"name": f"resource.{name}", "component": "resource", "quantity": name, "unit": "%"}
            for name in ("cpu_percent", "memory_percent")
        ]
        kinds = (
            dict.fromkeys(JOINTS, "joint")
            | dict.fromkeys(FEET, "insole")
            | {"trunk": "imu", "gait": "device"}
        )
        return {
            "robot": "exo-fake",
            "boot_id": self.boot_id,
            "role": "observer",
            "version": self.version,
            "components": [
                {
                    "name": name,
                    "kind": kind,
                    "state": "lost" if name in self.lost else "ok",
                    "problem": "no heartbeat; check its cable" if name in self.lost else None,
                }
                for name, kind in kinds.items()
            ],
            "channels": channels,
            "parameters": [
                {"name": name, "component": name.partition(".")[0], **self._meta(name)}
                for name in self.parameters
            ],
            "modules": dict.fromkeys(("resource", "component", "control", "status"), "off"),
            "stop": {"held": False, "reason": None, "since_ns": None, "stopped_again": {}, "drives": {}},
            "guard": {"configured": False},
            "trials": self._trials(),
            "clock": {"monotonic_ns": time.monotonic_ns(), "utc_ns": time.time_ns(), "boot_id": self.boot_id},
        }

    def _trials(self) -> list[Params]:
        if not self._trial:
            return []
        values = {name: self.parameters[name] for name in self._trial}
        return [{"write": 1, "who": "tester", "values": values, "before": self._trial, "left_s": 9.0}]

    @staticmethod
    def _meta(name: str) -> Params:
        unit, low, high = {
            "gait.step_length": ("m", 0.2, 0.6),
            "gait.cycle_time": ("s", 0.8, 2.5),
            "left_knee.max_torque": ("N·m", 0.0, 40.0),
        }[name]
        return {
            "unit": unit,
            "min": low,
            "max": high,
            "max_step": 0.1,
            "live": True,
            "states": None,
            "store": False,
            "object": "0x2001:0",
            "access": "rw",
        }

    @staticmethod
    def _wanted(name: str, globs: list[str] | None) -> bool:
        return globs is None or any(fnmatch.fnmatchcase(name, glob) for glob in globs)

    def _hello(self, params: Params) -> Params:
        return {
            "protocol": self.protocol,
            "robot": "exo-fake",
            "role": "observer",
            "boot_id": self.boot_id,
            "version": self.version,
        }

    def _resource(self, params: Params) -> Params:
        known, self._resource_asked = self._resource_asked, True
        processes = [
            {
                "pid": 10 + i,
                "name": f"process-{i}",
                "cpu_percent": 1.5 * i if known else None,
                "memory_bytes": i << 20,
            }
            for i in range(12)
        ]
        return {
            "stamp_ns": time.monotonic_ns(),
            "cpu": {
                "percent": 21.5 if known else None,
                "per_core": [20.0, 23.0] if known else [None, None],
                "load": [0.5, 0.4, 0.3],
            },
            "memory": {"total": 8 << 30, "available": 6 << 30, "used": 2 << 30, "swap_used": 0},
            "processes": processes,
            "gateway": {"cpu_percent": 0.7 if known else None, "rss_bytes": 15 << 20},
        }

    def _component(self, params: Params) -> Params:
        globs = params.get("channels")
        values = {name: value for name, value in self.values().items() if self._wanted(name, globs)}
        for glob in globs or ():
            if not any(fnmatch.fnmatchcase(name, glob) for name in self.values()):
                raise Refusal(-32000, f"there is no channel {glob!r}", kind="unknown_name")
        now_ns = time.monotonic_ns()
        components = {name.partition(".")[0] for name in values}
        return {
            "stamp_ns": now_ns,
            "values": values,
            "stamps_ns": dict.fromkeys(values, now_ns),
            "quality": {
                name: {"state": "lost", "age_ms": None, "problem": "no heartbeat; check its cable"}
                if name in self.lost
                else {"state": "ok", "age_ms": 1.5}
                for name in sorted(components)
            },
        }

    def _acquire(self, params: Params) -> Params:
        self._leased = True
        return {"lease": "lease-1", "expires_s": params.get("ttl_s", 10)}

    def _release(self, params: Params) -> Params:
        self._leased = False
        self.parameters.update(self._trial)
        self._trial = {}
        return {}

    def _revert(self, params: Params) -> Params:
        outcome = dict.fromkeys(self._trial, "taken back")
        self.parameters.update(self._trial)
        self._trial = {}
        return {"write": params["write"], "outcome": outcome}

    def _confirm(self, params: Params) -> Params:
        self._trial = {}
        return {"write": params["write"], "values": self.parameters}

    def _read(self, params: Params) -> Params:
        globs = params.get("names")
        names = [name for name in self.parameters if self._wanted(name, globs)]
        if not names:
            raise Refusal(-32000, f"there is no parameter {globs}", kind="unknown_name")
        now_ns = time.monotonic_ns()
        return {
            "values": {
                name: {"value": self.parameters[name], "stamp_ns": now_ns, **self._meta(name)}
                for name in names
            }
        }

    def _write(self, params: Params) -> Params:
        if not self._leased:
            raise Refusal(-32000, "take the lease first", kind="no_lease")
        changes = params["changes"]
        for name, value in changes.items():
            if name not in self.parameters:
                raise Refusal(-32000, f"there is no parameter {name!r}", kind="unknown_name")
            meta = self._meta(name)
            if not meta["min"] <= value <= meta["max"]:
                raise Refusal(
                    -32000, f"{name} = {value} is above {meta['max']} {meta['unit']}", kind="out_of_limit"
                )
        before = {name: self.parameters[name] for name in changes}
        self.parameters.update(changes)
        self._trial = before if params.get("trial_s") else {}
        return {"write": 1, "before": before, "after": dict(changes), "trial_s": params.get("trial_s")}
