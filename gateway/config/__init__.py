"""The robot's file: its tables, how it is read, and what cannot work in it."""

from gateway.config.reading import ConfigError, load, load_bytes, read
from gateway.config.robot import RobotConfig

__all__ = ["ConfigError", "RobotConfig", "load", "load_bytes", "read"]
