"""A model as bytes that cannot run anything: skops, under a fixed list of types, never the file's own.

Before skops sees a file, it is taken apart and written anew from what is known to be harmless: entries that
are not compressed, arrays as long as they say, objects of the types below. So the same model is also the same
bytes, wherever it is written. Nothing is imported or made while a file is looked through.
"""

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy.lib.format
import sklearn
import skops.io
from skops.io._protocol import PROTOCOL
from skops.io.exceptions import UntrustedTypesFoundException

from ml.errors import UnusableModel
from ml.parsing import parsing
from ml.registry.tree_checks import check_trees

MAX_BYTES: Final = 64 << 20
SCHEMA: Final = "schema.json"
_SKLEARN_VERSION: Final = "_sklearn_version"
_TIME: Final = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip file knows
_NOTHING: Final = {
    "__class__": "str",
    "__module__": "builtins",
    "__loader__": "JsonNode",
    "content": "null",
    "is_json": True,
}
_HEADERS: Final[Mapping[tuple[int, int], Callable[..., Any]]] = {
    (1, 0): numpy.lib.format.read_array_header_1_0,
    (2, 0): numpy.lib.format.read_array_header_2_0,
}
_TREES: Final = "sklearn.ensemble._hist_gradient_boosting"
# How skops says that something is to be made → of which types.
ALLOWED: Final[Mapping[str, frozenset[str]]] = {
    "JsonNode": frozenset({"builtins.str"}),
    "DictNode": frozenset({"builtins.dict", "sklearn.utils._bunch.Bunch"}),
    "ListNode": frozenset({"builtins.list"}),
    "TupleNode": frozenset({"builtins.tuple"}),
    "TypeNode": frozenset({"builtins.str"}),  # of a dictionary's keys
    "NdArrayNode": frozenset(
        f"numpy.{name}" for name in ("ndarray", "bool", "float32", "float64", "int32", "int64", "uint64")
    ),
    "LossNode": frozenset(
        f"sklearn._loss._loss.Cy{name}" for name in ("HalfBinomialLoss", "HalfMultinomialLoss")
    ),
    "ObjectNode": frozenset(
        {
            "sklearn._loss.link.Interval",
            "sklearn._loss.link.LogitLink",
            "sklearn._loss.link.MultinomialLogit",
            "sklearn._loss.loss.HalfBinomialLoss",
            "sklearn._loss.loss.HalfMultinomialLoss",
            "sklearn.covariance._empirical_covariance.EmpiricalCovariance",
            "sklearn.covariance._shrunk_covariance.LedoitWolf",
            "sklearn.decomposition._pca.PCA",
            f"{_TREES}.binning._BinMapper",
            f"{_TREES}.gradient_boosting.HistGradientBoostingClassifier",
            f"{_TREES}.predictor.TreePredictor",
            "sklearn.ensemble._voting.VotingClassifier",
            "sklearn.isotonic.IsotonicRegression",
            "sklearn.linear_model._logistic.LogisticRegression",
            "sklearn.mixture._gaussian_mixture.GaussianMixture",
            "sklearn.neural_network._multilayer_perceptron.MLPClassifier",
            "sklearn.neural_network._multilayer_perceptron.MLPRegressor",
            "sklearn.neural_network._stochastic_optimizers.AdamOptimizer",
            "sklearn.pipeline.Pipeline",
            "sklearn.preprocessing._data.StandardScaler",
            "sklearn.preprocessing._label.LabelBinarizer",
            "sklearn.preprocessing._label.LabelEncoder",
        }
    ),
}
_TYPES: Final = sorted(set().union(*ALLOWED.values()))


def dump(state: dict[str, Any]) -> bytes:
    """Return a model's state (values, arrays, fitted scikit-learn objects) as a file's content.

    Equal states give equal bytes. Random generators, which only learning needs, are left out.

    Raises:
        UnusableModel: it holds something that would not be loaded again.

    """
    try:
        data = skops.io.dumps(state)
    except Exception as error:
        raise UnusableModel(f"the model cannot be written: {error}") from error
    return _written_anew(bytes(data))


def load(data: bytes) -> dict[str, Any]:
    """Return the state in a file's content.

    Raises:
        UnusableModel: it is damaged, too large, of another kind or version, or holds a type that is not
            allowed; nothing of it was made then.

    """
    try:
        harmless = _written_anew(data)
        state = parsing(lambda: skops.io.loads(harmless, trusted=_TYPES))
        check_trees(state)
    except UnusableModel:
        raise
    except UntrustedTypesFoundException as error:
        raise UnusableModel(f"it holds types that no model of ours needs: {error}") from None
    except Exception as error:  # noqa: BLE001 - parts that do not fit can break anything in the libraries
        raise UnusableModel(f"its parts do not fit together: {_said(error)}") from None
    if not isinstance(state, dict):
        raise UnusableModel(f"it holds a {type(state).__name__} instead of a model's state")
    return state


def _written_anew(data: bytes) -> bytes:
    """Return the same content, of which every part is known; raises `UnusableModel`."""
    if len(data) > MAX_BYTES:
        raise UnusableModel(f"it has {len(data)} bytes; a model has at most {MAX_BYTES}")
    if data[:1] == b"\x80":
        raise UnusableModel("it is a pickle, which could run any program; it was not opened")
    try:
        return parsing(lambda: _rewritten(data))
    except UnusableModel:
        raise
    except zipfile.BadZipFile as error:
        raise UnusableModel(f"it is no model file, or a part of one is missing: {_said(error)}") from None
    except RecursionError:
        raise UnusableModel("its parts are nested too deep") from None
    except Exception as error:  # noqa: BLE001 - whatever a file does to who reads it, it is no model
        raise UnusableModel(f"it is damaged: {_said(error)}") from None


def _said(error: Exception) -> str:
    return str(error).partition("\n")[0][:200] or type(error).__name__


class _Rewriting:
    """One archive, looked through node by node and made again from what is allowed."""

    def __init__(self, archive: zipfile.ZipFile, size_bytes: int) -> None:
        entries = archive.infolist()
        packed = [entry.filename for entry in entries if entry.compress_type != zipfile.ZIP_STORED]
        if packed:
            raise UnusableModel(f"its entry {packed[0]!r} is compressed, and could unpack to any size")
        if sum(entry.file_size for entry in entries) > size_bytes:
            raise UnusableModel("its entries say that they are larger than the whole file")
        self._archive = archive
        self._files: dict[str, bytes] = {}

    def content(self) -> bytes:
        schema = json.loads(self._archive.read(SCHEMA))
        state = self._node(schema)
        if schema["protocol"] != PROTOCOL:
            raise UnusableModel(f"it has format {schema['protocol']} of skops, and {PROTOCOL} is read here")
        state["protocol"] = PROTOCOL
        packed = io.BytesIO()
        with zipfile.ZipFile(packed, "w") as archive:
            for name, data in (*sorted(self._files.items()), (SCHEMA, json.dumps(state).encode())):
                archive.writestr(zipfile.ZipInfo(name, _TIME), data)
        return packed.getvalue()

    def _node(self, node: Any) -> dict[str, Any]:
        how, kind = node["__loader__"], f"{node['__module__']}.{node['__class__']}"
        if how in ("RandomStateNode", "RandomGeneratorNode"):
            return dict(_NOTHING)
        if kind not in ALLOWED.get(how, ()):
            raise UnusableModel(
                f"it holds {kind} (made as {how}), which no model of ours needs; nothing was loaded"
            )
        known = {name: node[name] for name in ("__class__", "__module__", "__loader__")}
        return known | self._PARTS[how](self, node)

    def _sequence(self, node: Any) -> dict[str, Any]:
        return {"content": [self._node(each) for each in node["content"]]}

    def _mapping(self, node: Any) -> dict[str, Any]:
        content = {str(name): self._node(each) for name, each in node["content"].items()}
        if _SKLEARN_VERSION in content:
            content[_SKLEARN_VERSION] = _this_version(content[_SKLEARN_VERSION])
        return {"key_types": self._node(node["key_types"]), "content": content}

    def _value(self, node: Any) -> dict[str, Any]:
        json.loads(node["content"])
        return {"content": str(node["content"]), "is_json": True}

    def _object(self, node: Any) -> dict[str, Any]:
        return {"content": self._node(node["content"])} if "content" in node else {}

    def _loss(self, node: Any) -> dict[str, Any]:
        return self._object(node) | {"__reduce__": {"args": self._node(node["__reduce__"]["args"])}}

    def _array(self, node: Any) -> dict[str, Any]:
        if node["type"] != "numpy":
            raise UnusableModel("it holds an array of Python objects; arrays are of numbers or text")
        data = self._archive.read(node["file"])
        _check_array(data)
        name = f"{hashlib.sha256(data).hexdigest()[:32]}.npy"
        self._files[name] = data
        return {"type": "numpy", "file": name}

    def _nothing_more(self, node: Any) -> dict[str, Any]:  # noqa: ARG002 - as the others
        return {}

    _PARTS: Final[Mapping[str, Callable[["_Rewriting", Any], dict[str, Any]]]] = {
        "JsonNode": _value,
        "DictNode": _mapping,
        "ListNode": _sequence,
        "TupleNode": _sequence,
        "TypeNode": _nothing_more,
        "NdArrayNode": _array,
        "LossNode": _loss,
        "ObjectNode": _object,
    }


def _rewritten(data: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return _Rewriting(archive, len(data)).content()


def _check_array(data: bytes) -> None:
    """Refuse an array that is not as long as it says: room would be made for it before that is seen."""
    stream = io.BytesIO(data)
    shape, _, kind = _HEADERS[numpy.lib.format.read_magic(stream)](stream)
    said = math.prod(shape) * kind.itemsize
    if kind.hasobject or not kind.itemsize or min(shape, default=0) < 0:
        raise UnusableModel(f"it holds an array of {kind} with the shape {shape}")
    if said != len(data) - stream.tell():
        raise UnusableModel(f"an array says that it has {said} bytes, and has {len(data) - stream.tell()}")


def _this_version(node: dict[str, Any]) -> dict[str, Any]:
    """Return a part's version of scikit-learn as the one that runs, where both understand it alike."""
    made, here = str(json.loads(node["content"])), str(sklearn.__version__)
    if made.split(".")[:2] != here.split(".")[:2]:
        raise UnusableModel(
            f"it was made by scikit-learn {made}, and {here} runs here: learn it again, or install {made}"
        )
    return node | {"content": json.dumps(here)}
