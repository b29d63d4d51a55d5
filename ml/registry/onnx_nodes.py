"""ONNX nodes for parts of our models that scikit-learn's converter does not know."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from ml.robot.network import FAR

Floats = npt.NDArray[np.float64]

_LEGS: Final = 2


def cut_off(graph: Any) -> None:
    """Cut off between scale and network what is far out: it says no more."""
    at = next(place for place, node in enumerate(graph.node) if node.op_type == "Scaler")
    scaled = graph.node[at].output[0]
    for node in graph.node:
        node.input[:] = ["within" if name == scaled else name for name in node.input]
    limits = [_constant(graph, name, np.float32(limit)) for name, limit in (("least", -FAR), ("most", FAR))]
    graph.node.insert(at + 1, _made("Clip", [scaled, *limits], "within"))


def on_circle(graph: Any, length: Floats, trust: Floats) -> None:
    """Behind a network that points round the cycle: `phases` (n, 2), and how sure both are, (n, 1).

    `length` and `trust` (k,) make the shorter pointer's length a probability, as `numpy.interp` does.
    """
    _add(graph, "Cast", [graph.output[0].name], "pointers", to=_double())
    _add(graph, "Reshape", ["pointers", _constant(graph, "by leg", np.array([-1, _LEGS, 2]))], "legs")
    for index, name in enumerate(("cosine", "sine")):
        _add(graph, "Gather", ["legs", _constant(graph, f"of {name}", np.array(index))], name, axis=2)
    _phases(graph)
    _add(graph, "ReduceL2", ["legs"], "lengths", axes=[2], keepdims=0)
    _add(graph, "ReduceMin", ["lengths"], "shorter", axes=[1], keepdims=1)
    _interpolated(graph, np.append(length, length[-1] + 1.0), np.append(trust, trust[-1]))
    _give_out(graph, {"phases": _LEGS, "probabilities": 1})


def _phases(graph: Any) -> None:
    """Add nodes for the angle of each pointer, in cycles from 0 up to 1."""
    _add(graph, "Div", ["sine", "cosine"], "tangent")
    _add(graph, "Cast", ["tangent"], "single tangent", to=_float())  # ONNX Runtime has no other Atan
    _add(graph, "Atan", ["single tangent"], "single angle")
    _add(graph, "Cast", ["single angle"], "angle", to=_double())
    _add(graph, "Div", ["angle", _constant(graph, "cycle", np.array(2.0 * np.pi))], "half")
    _add(graph, "Less", ["cosine", _constant(graph, "zero", np.array(0.0))], "behind")
    _add(graph, "Cast", ["behind"], "is behind", to=_double())
    _add(graph, "Mul", ["is behind", _constant(graph, "half a cycle", np.array(0.5))], "other half")
    _add(graph, "Add", ["half", "other half"], "turned")
    _add(graph, "Floor", ["turned"], "whole cycles")
    _add(graph, "Sub", ["turned", "whole cycles"], "phase")
    _add(graph, "Cast", ["phase"], "phases", to=_float())


def _interpolated(graph: Any, knots: Floats, values: Floats) -> None:
    """Add nodes for a piecewise linear function between knots."""
    widths = np.diff(knots)
    _add(graph, "Sub", ["shorter", _constant(graph, "knots", knots[:-1])], "beyond")
    _add(graph, "Max", ["beyond", "zero"], "entered")
    _add(graph, "Min", ["entered", _constant(graph, "widths", widths)], "passed")
    slopes = (np.diff(values) / widths)[:, None]
    _add(graph, "MatMul", ["passed", _constant(graph, "slopes", slopes)], "risen")
    _add(graph, "Add", ["risen", _constant(graph, "lowest", values[:1])], "sure")
    _add(graph, "Cast", ["sure"], "probabilities", to=_float())


def _give_out(graph: Any, columns: dict[str, int]) -> None:
    from onnx import helper

    del graph.output[:]
    graph.output.extend(
        helper.make_tensor_value_info(name, _float(), [None, count]) for name, count in columns.items()
    )


def _add(graph: Any, kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> None:
    graph.node.append(_made(kind, inputs, output, **attributes))


def _made(kind: str, inputs: Sequence[str], output: str, **attributes: Any) -> Any:
    from onnx import helper

    return helper.make_node(kind, inputs, [output], **attributes)


def _constant(graph: Any, name: str, value: Any) -> str:
    from onnx import numpy_helper

    graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    return name


def _float() -> int:
    from onnx import TensorProto

    return int(TensorProto.FLOAT)


def _double() -> int:
    from onnx import TensorProto

    return int(TensorProto.DOUBLE)
