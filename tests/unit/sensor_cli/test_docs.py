"""What the chapter about wiring a sensor shows works as it stands there."""

from pathlib import Path

from drivers.cli.decode import FORMATS
from drivers.imu.canopen import FORMATS as CANOPEN_FORMATS
from gateway import config
from gateway.modules.component.assembly import assemble
from hil_sim.sensors.suite import IMUS, INSOLES
from tests.newcomer.pages import blocks

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "wire-a-sensor.md"


def test_the_table_of_a_sensor_builds_its_component(tmp_path: Path) -> None:
    table = next(block.text for block in blocks(PAGE) if block.language == "toml")
    file = tmp_path / "robot.toml"
    file.write_text(table, encoding="utf-8")
    robot = assemble(config.load(file))
    assert robot.absent == {}
    assert {"trunk.tilt_forward", "trunk.tilt_side"} <= {
        channel.name for channel in robot.components["trunk"].channels
    }


def test_the_document_names_every_format() -> None:
    text = PAGE.read_text(encoding="utf-8")
    known = {*FORMATS, *CANOPEN_FORMATS}
    assert [name for name in known if f"`{name}`" not in text and f'"{name}"' not in text] == []
    assert {imu.removesuffix("-binary") for imu in IMUS} | set(INSOLES) == known
