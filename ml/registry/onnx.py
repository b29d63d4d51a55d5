"""A classifier for other programs and engines: ONNX, which says what scikit-learn says.

Input `features` (n, columns) of the model's recipe, float32; outputs `label` (n,), an index into the card's
classes, and `probabilities` (n, classes), calibrated. Abstaining and novelty are left to who uses it.
"""

import copy
import importlib.util
from typing import Any, Final

import numpy as np

from ml.errors import UnusableModel
from ml.features.recipe import Features
from ml.robot.learned import Learned
from ml.robot.network import FAR

NEEDED: Final = ("onnx", "onnxruntime", "skl2onnx")
OPSET: Final = 17
TOLERANCE: Final = 1e-5  # of a probability
ROWS: Final = 256  # that both judge before a file is given out
_SPREAD: Final = 2.0  # standard deviations of those rows: some features lie where they are cut off


def exported(learned: Learned) -> bytes:
    """The model as ONNX, after both have judged the same rows.

    Raises:
        UnusableModel: it is no classifier, the extra `onnx` is not installed, or the two differ.

    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise UnusableModel(f"ONNX needs {', '.join(missing)}, not installed here: pip install 'gwrms[onnx]'")
    if "temperature" not in learned.numbers:
        raise UnusableModel(f"{learned.task.name} is no classifier: only those become ONNX")
    data = _converted(learned)
    _compare(learned, data)
    return data


def probabilities(data: bytes, features: Features) -> Any:
    """(n, classes), as the file says, by ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    return session.run(["probabilities"], {"features": np.asarray(features, dtype=np.float32)})[0]


def _converted(learned: Learned) -> bytes:
    from skl2onnx import to_onnx
    from sklearn.pipeline import make_pipeline

    network = copy.deepcopy(learned.parts["network"])
    network.coefs_[-1] = network.coefs_[-1] / learned.numbers["temperature"]
    network.intercepts_[-1] = network.intercepts_[-1] / learned.numbers["temperature"]
    scale = learned.parts["scale"]
    model: Any = to_onnx(
        make_pipeline(scale, network),
        initial_types=[("features", _floats(scale.n_features_in_))],
        options={"zipmap": False},
        target_opset=OPSET,
    )
    _cut_off(model.graph)
    data: bytes = model.SerializeToString()
    return data


def _floats(columns: int) -> Any:
    from skl2onnx.common.data_types import FloatTensorType

    return FloatTensorType([None, columns])


def _cut_off(graph: Any) -> None:
    """Between scale and network: what is far out says no more."""
    from onnx import helper, numpy_helper

    at = next(place for place, node in enumerate(graph.node) if node.op_type == "Scaler")
    scaled = graph.node[at].output[0]
    for node in graph.node:
        node.input[:] = ["within" if name == scaled else name for name in node.input]
    graph.initializer.extend(
        numpy_helper.from_array(np.array(limit, dtype=np.float32), name)
        for name, limit in (("least", -FAR), ("most", FAR))
    )
    graph.node.insert(at + 1, helper.make_node("Clip", [scaled, "least", "most"], ["within"]))


def _compare(learned: Learned, data: bytes) -> None:
    """Refuse a file that says something else than the model."""
    scale = learned.parts["scale"]
    random = np.random.default_rng(0).normal(scale=_SPREAD, size=(ROWS, scale.n_features_in_))
    rows = (scale.mean_ + random * scale.scale_).astype(np.float32)
    apart = float(np.abs(probabilities(data, rows) - learned.judge(rows).probabilities).max())
    if not apart <= TOLERANCE:
        raise UnusableModel(f"as ONNX it says something else: probabilities differ by up to {apart:.1e}")
