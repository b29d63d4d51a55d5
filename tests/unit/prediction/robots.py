"""What a robot's feed tells of its hips, a model that serves it, and what is predicted of that."""

import asyncio
import base64
import itertools
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from msgspec.structs import replace

from gateway import signatures
from gateway.certificates import der_of, fingerprint
from gateway.client import Batch, ClockOffset
from gateway.wire.component import ChannelInfo
from ml.registry.card import Card, DataSource
from ml.registry.code import features_hash, versions
from ml.registry.pointers import Sign
from ml.registry.registry import Registry
from ml.robot.learned import Learned
from server_gui.core.follow.events import Described, Telemetry
from server_gui.core.prediction.news import Predicted, PredictionNews, Ruled
from server_gui.core.prediction.service import PredictionService
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import ServerSettings, StoreSettings
from tests.fake_robot import FakeRobot
from tests.support.waiting import until
from tests.unit.gateway import keyed as keys
from tests.unit.ml.serving.small import CHANNELS, MS, STEP_MS, Floats, hips, learned
from tests.unit.recording.robots import description

AGAIN_S = 0.05
ROBOT = "exo-01"
ROWS = 10  # in a batch


def described(boot_id: str = "boot-1", unit: str = "rad") -> Described:
    channels = [ChannelInfo(name, unit, name.partition(".")[0], "position") for name in CHANNELS]
    told = description(ROBOT)
    return Described(replace(told, boot_id=boot_id, channels=channels))


def telemetry(rows: Floats, begin_ns: int = 0) -> Iterator[Telemetry]:
    """Batches of rows every 10 ms of the robot's clock, which is 5 s behind ours."""
    for at in range(0, len(rows), ROWS):
        part = rows[at : at + ROWS]
        stamps = [begin_ns + (at + row) * STEP_MS * MS for row in range(len(part))]
        columns = dict(zip(CHANNELS, part.T.tolist(), strict=True))
        received_ns = stamps[-1] + 5_000 * MS
        yield Telemetry(1, Batch(stamps, columns, at, 0, 0, 1, received_ns), ClockOffset(-5_000 * MS, 1))


def walking() -> Iterator[Telemetry]:
    """Batches of somebody who walks, for as long as they are asked for."""
    for minute in itertools.count():
        rows = hips(60, walks=True, seed=minute)
        yield from telemetry(rows, begin_ns=minute * len(rows) * STEP_MS * MS)


def signature(whose: str) -> Sign:
    """What signs with somebody's key."""
    key, certificate = keys.pair(whose)

    def sign(message: bytes) -> tuple[str, str]:
        return certificate.read_text(), base64.b64encode(signatures.sign(key, message)).decode()

    return sign


def promoters(*names: str) -> dict[str, str]:
    """By whose models rules may stop robots."""
    return {name: fingerprint(der_of(keys.pair(name)[1].read_bytes())) for name in names}


def publish(
    url: str, model: Learned | None = None, robot: str = "", by: str | None = None, **changes: Any
) -> str:
    """A model that serves from now on; signed, where it is promoted `by` somebody."""
    model = model or learned()
    registry = Registry(url, sign=None if by is None else signature(by))
    name = registry.publish(model.state(), card(model, **changes))
    registry.promote(name, robot, who="tester", why="a test")
    return name


def card(model: Learned, **changes: Any) -> Card:
    fields: dict[str, Any] = {
        "task": model.task.name,
        "recipe": model.recipe.name,
        "classes": model.classes,
        "channels": model.recipe.channels,
        "units": dict.fromkeys(model.recipe.channels, "rad"),
        "features_hash": features_hash(model.recipe),
        "source": DataSource.SIMULATED,
        "seed": 0,
        "made": datetime.now(UTC),
        "versions": versions(),
    }
    return Card(**(fields | changes))


def settings(url: str, *rules: RuleSettings) -> ServerSettings:
    return ServerSettings(store=StoreSettings(url), prediction=PredictionSettings(poll_s=1.0), rules=rules)


@dataclass
class Told:
    """What prediction has told, for a test to wait for."""

    news: list[PredictionNews] = field(default_factory=list)
    stops: list[Ruled] = field(default_factory=list)
    stopped_s: float = 0.0  # when the newest stop was asked for, on our monotonic clock
    order: list[object] = field(default_factory=list)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def tell(self, news: Sequence[PredictionNews]) -> None:
        with self.lock:
            self.news += news
            self.order += news

    def stop(self, ruled: Ruled) -> None:
        self.stopped_s = time.monotonic()
        self.stops.append(ruled)
        self.order.append("stop")

    def until(self, condition: Callable[[], object], between: Callable[[], object] = lambda: None) -> None:
        """Wait for a condition on what is told, doing something again and again, however much is told."""

        def is_so() -> object:
            with self.lock:
                return condition()

        def again() -> None:
            between()
            time.sleep(AGAIN_S)

        until(is_so, lambda: self.news[-3:], step=again)

    def predicted(self, robot: str = ROBOT) -> list[Predicted]:
        return [one for one in self.news if isinstance(one, Predicted) and one.robot == robot]

    def ruled(self) -> list[Ruled]:
        return [one for one in self.news if isinstance(one, Ruled)]


@contextmanager
def predicting(server: ServerSettings) -> Iterator[tuple[PredictionService, Told]]:
    told = Told()
    with PredictionService(server, told.tell, told.stop) as one:
        yield one, told


def served(
    predicting: PredictionService, told: Told, robot: str = ROBOT, event: Described | None = None
) -> None:
    """Introduce a robot, and wait until a model serves it, so that its first row is seen already."""
    predicting.take(robot, event or described())
    told.until(lambda: (robot, "activity") in predicting.models)


class SteadyRobot(FakeRobot):
    """A fake robot whose rows are 10 ms apart on its own clock, however busy the computer is."""

    def __init__(self) -> None:
        super().__init__()
        self._now_ns = time.monotonic_ns()

    def values(self) -> dict[str, float | None]:
        positions = hips(STEP_MS / 1000, walks=True, seed=self._now_ns % 997, begin_s=self._now_ns / 1e9)
        return super().values() | dict(zip(CHANNELS, positions[0].tolist(), strict=True))

    async def _stream(self, writer: asyncio.StreamWriter, number: int, params: dict[str, Any]) -> None:
        names = [name for name in self.values() if self._wanted(name, params.get("channels"))]
        self._now_ns = time.monotonic_ns()
        for seq in itertools.count():
            await asyncio.sleep(ROWS * STEP_MS / 1000)
            rows = [self._row(names) for _ in range(ROWS)]
            columns = {name: [row[name] for _, row in rows] for name in names}
            data = {"stream": number, "seq": seq, "dropped": 0, "stamp_ns": [stamp for stamp, _ in rows]}
            self._send(writer, {"method": "stream.data", "params": data | {"columns": columns}})

    def _row(self, names: Sequence[str]) -> tuple[int, dict[str, float | None]]:
        self._now_ns += STEP_MS * MS
        values = self.values()
        return self._now_ns, {name: values[name] for name in names}
