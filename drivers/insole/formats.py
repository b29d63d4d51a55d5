"""The insole formats by name, as the robot's file and `gwrms sensor` know them."""

from collections.abc import Callable

from drivers.insole.cobs import InsoleCobsParser
from drivers.insole.frame import InsoleFrame
from drivers.parsing import Parser

FORMATS: dict[str, Callable[[], Parser[InsoleFrame]]] = {
    "insole-cobs": InsoleCobsParser,
}
