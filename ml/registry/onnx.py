"""A model for other programs and engines: ONNX, which says what scikit-learn says.

Input `features` (n, columns) of the model's recipe, float32. Outputs of a classifier: `label` (n,), an index
into the card's classes, and `probabilities` (n, classes), calibrated; of gait_phase: `phases` (n, 2) of the
left and the right leg, from 0 up to 1, and `probabilities` (n, 1), that both are within a tenth. Abstaining
and novelty are left to who uses it.
"""

import copy
import importlib.util
from typing import Any, Final

import numpy as np

from ml.errors import UnusableModel
from ml.features.recipe import Features
from ml.registry.onnx_nodes import cut_off, on_circle
from ml.robot import learned as ours
from ml.robot.learned import Learned
from ml.robot.network import outputs

NEEDED: Final = ("onnx", "onnxruntime", "skl2onnx")
OPSET: Final = 17
TOLERANCE: Final = 1e-5  # of a probability, of a cycle, of a pointer's length
ROWS: Final = 256  # that both judge before a file is given out
_SPREAD: Final = 2.0  # standard deviations of those rows: some features lie where they are cut off


def exported(learned: Learned) -> bytes:
    """Return the model as ONNX, after both have judged the same rows.

    Raises:
        UnusableModel: the extra `onnx` is not installed, or the two differ.

    """
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise UnusableModel(f"ONNX needs {', '.join(missing)}, not installed here: pip install 'gwrms[onnx]'")
    data = _converted(learned)
    scale = learned.parts["scale"]
    random = np.random.default_rng(0).normal(scale=_SPREAD, size=(ROWS, scale.n_features_in_))
    apart = differs(learned, data, (scale.mean_ + random * scale.scale_).astype(np.float32))
    if not apart <= TOLERANCE:
        raise UnusableModel(f"as ONNX it says something else: what it says differs by up to {apart:.1e}")
    return data


def said(data: bytes, features: Features) -> dict[str, Any]:
    """Return the file's outputs, by ONNX Runtime."""
    import onnxruntime

    session = onnxruntime.InferenceSession(data, providers=["CPUExecutionProvider"])
    names = [output.name for output in session.get_outputs()]
    return dict(zip(names, session.run(names, {"features": np.asarray(features, np.float32)}), strict=True))


def differs(learned: Learned, data: bytes, features: Features) -> float:
    """Return by how much the file differs from the model: of a probability, or of a cycle.

    A phase counts by its pointer's length: one of no length has none. A pointer that is a little shorter
    may be as sure as that: how sure it is can rise at once.
    """
    found = said(data, features)
    if learned.task.fold:
        return float(np.abs(found["probabilities"] - learned.judge(features).probabilities).max())
    inputs = ours.scaled(learned.parts["scale"], features)
    phases, lengths = ours.on_circle(outputs(learned.parts["network"], inputs))
    turned = np.abs((found["phases"] - phases + 0.5) % 1.0 - 0.5) * lengths
    low, high = (
        np.interp(lengths.min(axis=1) + more, learned.parts["length"], learned.parts["trust"])
        for more in (-TOLERANCE, TOLERANCE)
    )
    sure = found["probabilities"][:, 0]
    return float(max(turned.max(), (low - sure).max(), (sure - high).max()))


def _converted(learned: Learned) -> bytes:
    from skl2onnx import to_onnx
    from sklearn.pipeline import make_pipeline

    scale, network = learned.parts["scale"], copy.deepcopy(learned.parts["network"])
    if learned.task.fold:
        network.coefs_[-1] = network.coefs_[-1] / learned.numbers["temperature"]
        network.intercepts_[-1] = network.intercepts_[-1] / learned.numbers["temperature"]
    model: Any = to_onnx(
        make_pipeline(scale, network),
        initial_types=[("features", _floats(scale.n_features_in_))],
        options={"zipmap": False} if learned.task.fold else None,
        target_opset=OPSET,
    )
    cut_off(model.graph)
    if not learned.task.fold:
        on_circle(model.graph, learned.parts["length"], learned.parts["trust"])
    data: bytes = model.SerializeToString()
    return data


def _floats(columns: int) -> Any:
    from skl2onnx.common.data_types import FloatTensorType

    return FloatTensorType([None, columns])
