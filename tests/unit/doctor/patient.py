"""A simulated robot in simulated time, looked at from outside: bus, SDO answers, sensors by robot.toml."""

import tomllib
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import eds
from drivers.bus.interfaces.controller_state import BusState
from drivers.imu import rotation
from drivers.joint.scaling import scalings
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library, files
from gateway.config.reading import examined
from gateway.config.robot import RobotConfig
from gateway.doctor.gathering.computer import computer as look_at
from gateway.doctor.gathering.objects import wanted
from gateway.doctor.observations import (
    BusFacts,
    Computer,
    IdentifierFrames,
    NodeTable,
    Object,
    Observations,
    Place,
    Samples,
    Value,
)
from hil_sim import robot_file
from hil_sim.bus.can_bus import Frame
from hil_sim.channels import UNITS, reported
from hil_sim.exoskeleton import JOINTS, Exoskeleton, Scenario
from hil_sim.mistakes import computer, registry
from hil_sim.mistakes.mistake import written

WARM_S = 3.0  # until it walks
EVERY = 2  # of the sensors' cycles: 50 Hz


class Patient:
    """A robot with mistakes, switched on and looked at for so long; `seen` is what that showed.

    Of what was seen once, `seen` can tell what it would be by another file or on another computer.
    """

    def __init__(
        self,
        folder: Path,
        mistakes: Collection[str] = (),
        seconds: float = 1.5,
        drives: Mapping[str, Path] | None = None,
        warm_s: float = WARM_S,
    ) -> None:
        self.robot = Exoskeleton(Scenario.WALK, drives=drives)
        self._folder = folder
        self._mistakes = tuple(mistakes)
        for mistake in registry.chosen(mistakes):
            if mistake.act is not None:
                mistake.act(self.robot)
        self._counts: Counter[int] = Counter()
        self._asks: Counter[int] = Counter()
        self._answers: dict[int, bytes] = {}
        self._errors = self._cycles = 0
        self._rows: list[dict[str, float | None]] = []
        self._seen: dict[tuple[str, ...], Observations] = {}
        self.robot.bus.attach(self, self._take, self._error)
        self.robot.measured.append(self._sample)
        self.robot.power_on()
        self._run(warm_s)
        self._look(seconds)

    def _look(self, seconds: float) -> None:
        before = self.robot.bus.busy_ns
        self._counts.clear()
        self._asks.clear()
        self._rows.clear()
        self._errors = 0
        self._run(seconds)
        load = 100.0 * (self.robot.bus.busy_ns - before) / (seconds * 1e9)
        self._facts = self._bus(seconds, load)
        self._walked = tuple(self._rows)
        config = self._config(())
        places = tuple(self._empty(config).nodes())
        self._objects = {
            place.table.node_id: self._asked(
                place, eds.load(eds.locate(place.table.eds, None), place.table.node_id)
            )
            for place in places
        }

    def _config(self, more: Collection[str]) -> RobotConfig:
        chosen = registry.chosen((*self._mistakes, *more))
        text = robot_file.text(self._folder, robot_file.hub_bus(1), self.robot)
        text = written(text, [line for one in chosen for line in one.lines], str(self._folder))
        found = examined(self._folder / "robot.toml", tomllib.loads(text))
        assert found.config is not None, found.findings
        return found.config

    def _empty(self, config: RobotConfig) -> Observations:
        tables: dict[str, NodeTable] = {**config.joint, **config.device}
        descriptions = {
            name: eds.load(eds.locate(table.eds, config.path), table.node_id)
            for name, table in tables.items()
        }
        return Observations(config, descriptions, {"main": self._facts}, {}, Samples(), Computer())

    def seen(self, *more: str) -> Observations:
        """What was seen, by a file and on a computer with more mistakes."""
        if more not in self._seen:
            self._seen[more] = self._by(more)
        return self._seen[more]

    def _by(self, more: tuple[str, ...]) -> Observations:
        config = self._config(more)
        empty = self._empty(config)
        objects = {
            place.name: held for place in empty.nodes() if (held := self._objects.get(place.table.node_id))
        }
        ports = [self._folder / name for name in self.robot.sensors.lines]
        root = computer.write(self._folder, ports, registry.chosen((*self._mistakes, *more)))
        return replace(
            empty,
            objects=objects,
            samples=self._samples(config),
            computer=look_at(config, root),
            proposals=proposals(empty, objects),
        )

    def _run(self, seconds: float) -> None:
        self.robot.clock.run_until(self.robot.clock.now_ns + round(seconds * 1e9))

    def _take(self, frame: Frame, _sender: object) -> None:
        self._counts[frame.cob_id] += 1
        if 0x600 < frame.cob_id < 0x680 and frame.data[0] >> 5 in (1, 2):
            self._asks[frame.cob_id] += 1
        if 0x580 < frame.cob_id < 0x600:
            self._answers[frame.cob_id - 0x580] = frame.data

    def _error(self, _kind: int) -> None:
        self._errors += 1

    def _bus(self, seconds: float, load: float) -> BusFacts:
        heard = {
            id_: IdentifierFrames(count, count / seconds, self._asks[id_])
            for id_, count in self._counts.items()
        }
        state = BusState.PASSIVE if self._errors and not heard else BusState.ACTIVE
        frames = sum(self._counts.values()) / seconds
        return BusFacts(seconds, heard, frames, load, self._errors / seconds, state)

    def _asked(self, place: Place, description: eds.Description) -> dict[Object, Value]:
        node = place.table.node_id
        found: dict[Object, Value] = {}
        for index, subindex in wanted(place, description):
            self._answers.pop(node, None)
            question = bytes([0x40, index & 0xFF, index >> 8, subindex, 0, 0, 0, 0])
            self.robot.bus.send(Frame(0x600 + node, question), self)
            answer = None
            for _ in range(20):
                self._run(0.001)
                if (answer := self._answers.get(node)) is not None:
                    break
            if answer is None:
                return {}
            if answer[0] >> 5 == 2 and answer[0] & 2 and answer[1:4] == question[1:4]:
                size = 4 - (answer[0] >> 2 & 3) if answer[0] & 1 else 4
                found[index, subindex] = int.from_bytes(answer[4 : 4 + size], "little")
            elif answer[0] == 0x80:
                found[index, subindex] = None
        return found

    def _sample(self) -> None:
        self._cycles += 1
        if self._cycles % EVERY == 0:
            self._rows.append(dict(zip(UNITS, reported(self.robot), strict=True)))

    def _samples(self, config: RobotConfig) -> Samples:
        return Samples(0.01 * EVERY, dict(self._told(config)))

    def _told(self, config: RobotConfig) -> Iterator[tuple[str, tuple[float | None, ...]]]:
        """What a gateway with that file makes of what was walked."""
        drives = {node: name for name, node in JOINTS.items()}
        for name, table in config.joint.items():
            drive, known = drives[table.node_id], scalings(table, {})
            per_radian = self.robot.drives[drive].counts_per_radian
            for quantity in ("position", "velocity"):
                scaling = known[quantity]
                assert scaling is not None
                values = self._numbers(f"{drive}.{quantity}")
                yield (
                    f"{name}.{quantity}",
                    tuple(value * per_radian * scaling.scale + scaling.offset for value in values),
                )
        for name, insole in config.insole.items():
            port = Path(insole.port).name
            yield f"{name}.force", tuple(row[f"{port}.force"] for row in self._walked)
        for name, imu in config.imu.items():
            turn = rotation.from_axes(imu.axes or ("x", "y", "z"))
            felt = [tuple(row[f"trunk.acceleration_{axis}"] or 0.0 for axis in "xyz") for row in self._walked]
            turned = zip(*(rotation.rotate(turn, (x, y, z)) for x, y, z in felt), strict=True)
            for axis, column in zip("xyz", turned, strict=True):
                yield f"{name}.acceleration_{axis}", tuple(column)

    def _numbers(self, channel: str) -> Iterator[float]:
        for row in self._walked:
            value = row[channel]
            assert value is not None
            yield value


@cache
def library() -> Library:
    return Library(files([]))


def proposals(seen: Observations, objects: Mapping[str, Mapping[Object, Value]]) -> dict[str, str]:
    """The EDS that ships for what each device says it is."""
    found = {}
    for place in seen.nodes():
        told = objects.get(place.name, {})
        vendor, product = told.get((0x1018, 1)), told.get((0x1018, 2))
        if vendor is not None and product is not None:
            fits = library().proposals(place.table.node_id, _told(int(vendor), int(product)))
            if fits:
                found[place.name] = fits[0].description.path.name
    return found


def _told(vendor: int, product: int) -> NodeAnswers:
    return NodeAnswers(0x20192, None, None, None, None, vendor, product, None, None, None, (), ())
