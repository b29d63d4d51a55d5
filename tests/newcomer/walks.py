"""The walks of the three who come new, page by page, and what each of them types on the way."""

from collections.abc import Mapping
from typing import Final

INTEGRATOR: Final = "integrator"  # has a robot, and wires joints and sensors
BENCH: Final = "bench-tester"  # breaks a simulated one, and makes tests of that
DEVELOPER: Final = "developer"  # changes, tries, compares, records, plots, learns

WALKS: Final[Mapping[str, tuple[str, ...]]] = {
    INTEGRATOR: (
        "README.md: You have a robot and want to monitor it",
        "how-to/install.md",
        "how-to/first-robot.md",
        "how-to/wire-a-joint.md",
        "how-to/look-at-a-bus.md",
        "how-to/wire-a-sensor.md",
        "how-to/check-files.md",
        "how-to/doctor.md",
        "how-to/run-as-a-service.md",
        "how-to/measure-the-cost.md",
        "how-to/add-an-imu.md",
        "how-to/add-an-insole.md",
    ),
    BENCH: (
        "README.md: You test on a bench",
        "how-to/bench.md",
        "how-to/scenarios.md",
    ),
    DEVELOPER: (
        "README.md: One command",
        "tutorial/first-walk.md",
        "README.md: You write software",
        "how-to/write-a-script.md",
        "how-to/record.md",
        "how-to/predict.md",
        "how-to/train.md",
    ),
}

PASSED: Final[Mapping[str, tuple[str, ...]]] = {
    INTEGRATOR: (
        "pip install",
        "gwrms eds ",
        "gwrms lss ",
        "gwrms trace ",
        "gwrms od ",
        "gwrms sensor ",
        "gwrms calibrate imu ",
        "gwrms check ",
        "gwrms doctor ",
        "gwrms gateway ",
        "gwrms describe",
        "gwrms top",
        "gwrms install-service ",
    ),
    BENCH: ("gwrms sim ", "gwrms sim-fault ", "gwrms sim run ", "--junit", "pytest --gwrms", "--replay"),
    DEVELOPER: (
        "./dev demo",
        "gwrms set ",
        "gwrms set --trial",
        "gwrms params save",
        "gwrms params compare",
        "gwrms journal",
        "gwrms collect ",
        "gwrms sessions export",
        "gwrms plot ",
        "from gwrms import Robot",
        "gwrms train ",
    ),
}
