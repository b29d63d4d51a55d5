"""The server's file as a JSON Schema, from the structs that read it."""

from gateway.tables.schema import Schema, definitions, document, named, ref
from ml.robot.task import ABNORMAL, TASKS
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import RecordingSettings, RobotSettings, StoreSettings


def schema() -> Schema:
    """All of it."""
    defs = definitions([RobotSettings, StoreSettings, RecordingSettings, PredictionSettings, RuleSettings])
    rule = defs[RuleSettings.__name__]["properties"]
    rule["task"]["enum"] = list(TASKS)
    labels = (label for task in TASKS.values() for label in (*task.support, ABNORMAL))
    rule["label"]["enum"] = list(dict.fromkeys(labels))
    properties = {
        "robots": named({"anyOf": [{"type": "string"}, ref(RobotSettings)]}),
        "store": ref(StoreSettings),
        "recorder": ref(RecordingSettings),
        "prediction": ref(PredictionSettings),
        "rules": {"type": "array", "items": ref(RuleSettings)},
    }
    return document("server.toml", properties, [], defs)
