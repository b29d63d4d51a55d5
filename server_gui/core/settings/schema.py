"""The server's file as a JSON Schema, from the structs that read it."""

from gateway.tables.schema import Schema, definitions, document, named, ref
from ml.robot.classes import ABNORMAL, CLASSES
from server_gui.core.settings.prediction import PredictionSettings, RuleSettings
from server_gui.core.settings.server_file import RecordingSettings, RobotSettings, StoreSettings


def schema() -> Schema:
    """Return all of it."""
    defs = definitions([RobotSettings, StoreSettings, RecordingSettings, PredictionSettings, RuleSettings])
    rule = defs[RuleSettings.__name__]["properties"]
    rule["task"]["enum"] = list(CLASSES)
    labels = (label for classes in CLASSES.values() for label in (*classes, ABNORMAL))
    rule["label"]["enum"] = list(dict.fromkeys(labels))
    properties = {
        "robots": named({"anyOf": [{"type": "string"}, ref(RobotSettings)]}),
        "store": ref(StoreSettings),
        "recorder": ref(RecordingSettings),
        "prediction": ref(PredictionSettings),
        "rules": {"type": "array", "items": ref(RuleSettings)},
        "promoters": named({"type": "string", "pattern": "^[0-9a-fA-F ]{64,}$"}),
    }
    return document("server.toml", properties, [], defs)
