"""docs/reference/server-toml.md: every table of the server's file, from the structs that read it."""

from collections.abc import Iterator
from typing import Final

from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import RecordingSettings, RobotSettings, StoreSettings
from tools.draw.structs import docstring, table, written

PAGE: Final = "server-toml.md"
_HEAD: Final = """# server.toml

The desk's and the collector's file: `--config FILE`, or `~/.config/gwrms/server.toml`. All of it may be
left out. Robots that `--robot` names come on top. How it is used: [record robots](../how-to/record.md),
[predict](../how-to/predict.md#rules). What is wrong with one: [check files](../how-to/check-files.md)."""
_TABLES: Final = (
    ("`[robots]`", RobotSettings, 'Usually just NAME = "HOST:PORT". The name is the robot\'s in the store.'),
    (
        "`[store]`",
        StoreSettings,
        """`url` is `file:///folder` (without it `~/.local/share/gwrms/store`) or `s3://bucket/prefix`; keys
for S3 come from the AWS environment or profile, never from here. `shards` and `several_writers`: [how far one
store goes](../explanation/scale.md). With `compact_h = 0` somebody else says `gwrms cloud compact`, as
where several servers share a store, or the network is dear; a collector never compacts a store with one
writer alone, and only while `upload` allows it.""",
    ),
    (
        "`[recorder]`",
        RecordingSettings,
        """`spool` is `~/.local/share/gwrms/spool` without this key; one collector a spool. `upload`:
`"always"`, as soon as a batch is full; `"idle"`, while no robot has sent a row for 10 s, so that a shared
radio link stays the robots' own, but with more than 2 GiB waiting at once; `"manual"`, when `gwrms collect
--upload` says so.""",
    ),
    (
        "`[prediction]`",
        PredictionSettings,
        """`every_ms` is by task; without it `{ activity = 100, gait_phase = 40, falling = 40 }`. What
models say of each robot is recorded too.""",
    ),
    (
        "`[[rules]]`",
        RuleSettings,
        "Without such a table there are none. Try a rule before it may stop a robot.",
    ),
)
_PROMOTERS: Final = """## `[promoters]`

Whose models a rule may stop a robot by: NAME = "SHA-256", the line that `gwrms models key` says on
their desk. Without it, no rule stops a robot ([who promoted it](models.md#who-promoted-it))."""


def draw() -> str:
    """The page."""
    return "\n\n".join([_HEAD, *_sections(), _PROMOTERS]) + "\n"


def _sections() -> Iterator[str]:
    for title, struct, more in _TABLES:
        yield f"## {title}"
        yield docstring(struct)
        yield table(written(struct))
        if more:
            yield more
