"""docs/reference/server-toml.md: every table of the server's file, from the structs that read it."""

from collections.abc import Iterator
from typing import Final

from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import RecordingSettings, RobotSettings, StoreSettings
from tools.draw.structs import docstring, table, written

PAGE: Final = "server-toml.md"
_HEAD: Final = """# server.toml

The file of the desk and the collector: `--config FILE`, or `~/.config/gwrms/server.toml`. All of it is
optional; `--robot` adds robots. Its use: [record robots](../how-to/record.md),
[predict](../how-to/predict.md#rules). To find mistakes in it: [check files](../how-to/check-files.md)."""
_TABLES: Final = (
    ("`[robots]`", RobotSettings, 'Usually just NAME = "HOST:PORT". NAME is the robot\'s name in the store.'),
    (
        "`[store]`",
        StoreSettings,
        """The default of `url` is `~/.local/share/gwrms/store`; keys for S3 come from the AWS environment or
profile, never from this file. On `shards` and `several_writers`: [scale](../explanation/scale.md). Set
`compact_h = 0` and run `gwrms cloud compact` elsewhere if several servers share a store, or if the network is
expensive. A collector compacts only with `several_writers`, and only while `upload` allows it.""",
    ),
    (
        "`[recorder]`",
        RecordingSettings,
        """The default of `spool` is `~/.local/share/gwrms/spool`; each collector needs its own. `upload`:
`"always"`: as soon as a batch is full; `"idle"`: while no robot has sent a row for 10 s, to leave a shared
radio link to the robots, but at once with more than 2 GiB pending; `"manual"`: on
`gwrms collect --upload`.""",
    ),
    (
        "`[prediction]`",
        PredictionSettings,
        """The default of `every_ms` is `{ activity = 100, gait_phase = 40, falling = 40 }`. Predictions are
recorded, too.""",
    ),
    (
        "`[[rules]]`",
        RuleSettings,
        """There are no rules by default. `"stop"` stops the robot only if one of `[promoters]` promoted the
serving model; otherwise the event says *NOT STOPPED*, with the reason. The calibration of `danger` cannot be
promoted, so a rule on it never stops a robot. Test a rule on recordings before it may stop a robot.""",
    ),
)
_PROMOTERS: Final = """## `[promoters]`

Desks whose promoted models may stop a robot by a rule with `action = "stop"`: NAME = "SHA-256", the line
printed by `gwrms models key` on that desk. Without this table no rule stops a robot, and all of them still
raise alarms ([promoters](models.md#who-promoted-it))."""


def draw() -> str:
    """Return the page."""
    return "\n\n".join([_HEAD, *_sections(), _PROMOTERS]) + "\n"


def _sections() -> Iterator[str]:
    for title, struct, more in _TABLES:
        yield f"## {title}"
        yield docstring(struct)
        yield table(written(struct))
        if more:
            yield more
