"""The robot's file."""

from gateway.config import ConfigError, load
from tests.fuzz.files import as_file

TOKENS = (
    b"[robot]\n",
    b"name = ",
    b"[can.main]\n",
    b"interface = ",
    b"[joint.k]\n",
    b"node_id = ",
    b"[imu.trunk]\n",
    b'[parameter."k.x"]\n',
    b'object = "0x2001:0"\n',
    b"[guard]\n",
    b"[guard.rule.r]\n",
    b"watch = ",
    b"[stop]\n",
    b"nan",
    b"inf",
    b"1979-05-27",
    b"[[",
    b"{}",
    b"true",
    b'"""',
    b"[control_loop]\n",
    b"[insole.left]\n",
    b':256"',
    b':0xFF"',
    b"99",
    b"127",
    b"1.0",
)
MODULES = (
    "gateway.config.checks",
    "gateway.config.likelihood",
    "gateway.config.objects",
    "gateway.config.parameter_checks",
    "gateway.config.reading",
    "gateway.config.robot",
    "gateway.tables.decoding",
    "gateway.tables.finding",
    "gateway.tables.reading",
)


def fuzz(data: bytes) -> None:
    with as_file("robot.toml", data) as path:
        try:
            config = load(path)
        except ConfigError as error:
            assert str(error).startswith(f"{path}: ")
            return
    for name, parameter in config.parameter.items():
        index, subindex = parameter.address
        assert 0 <= index <= 0xFFFF
        assert 0 <= subindex <= 0xFF
        assert config.drives_of(name.partition(".")[0]) is not None
