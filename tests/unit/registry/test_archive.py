"""Models as bytes: what is written comes back, and nothing but what is known to be harmless is loaded."""

import functools
import io
import json
import operator
import os
import pickle
import re
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import skops.io
from sklearn.covariance import LedoitWolf
from sklearn.ensemble import ExtraTreesClassifier, HistGradientBoostingClassifier, VotingClassifier
from sklearn.isotonic import IsotonicRegression
from sklearn.linear_model import LogisticRegression
from sklearn.neural_network import MLPClassifier
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from threadpoolctl import threadpool_limits

from ml.errors import UnusableModel
from ml.registry import archive
from ml.registry.archive import SCHEMA

RANDOM = np.random.default_rng(0)
X = RANDOM.normal(size=(200, 4)).astype(np.float32)
Y = np.where(X[:, 0] + X[:, 1] > 0.5, "walk", np.where(X[:, 2] > 0, "stand", "sit"))


def trees() -> Any:
    with threadpool_limits(1):  # more of them only wait for each other
        return HistGradientBoostingClassifier(max_iter=4, max_features=0.5, random_state=0).fit(X, Y)


def network() -> Any:
    with warnings.catch_warnings(action="ignore"):
        return make_pipeline(StandardScaler(), MLPClassifier((8,), max_iter=3, random_state=0)).fit(X, Y)


def vote() -> Any:
    parts = [("trees", trees()), ("line", LogisticRegression())]
    with threadpool_limits(1):
        return VotingClassifier(parts, voting="soft").fit(X, Y)


def entries(data: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(data)) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def packed(files: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", compression) as opened:
        for name, data in files.items():
            opened.writestr(name, data)
    return made.getvalue()


def altered(data: bytes, alter: Callable[[Any], None]) -> bytes:
    """The same file with its schema altered."""
    files = entries(data)
    schema = json.loads(files[SCHEMA])
    alter(schema)
    return packed(files | {SCHEMA: json.dumps(schema).encode()})


@pytest.mark.parametrize("make", [trees, network, vote])
def test_a_model_says_the_same_when_it_comes_back(make: Callable[[], Any]) -> None:
    model = make()
    state = archive.load(archive.dump({"parts": {"model": model}, "numbers": {"threshold": 0.4}}))
    assert state["numbers"] == {"threshold": 0.4}
    np.testing.assert_array_equal(state["parts"]["model"].predict_proba(X), model.predict_proba(X))


def test_parts_without_probabilities_come_back_too() -> None:
    line = IsotonicRegression(out_of_bounds="clip").fit(X[:, 0], X[:, 1])
    shape = LedoitWolf().fit(X)
    state = archive.load(archive.dump({"line": line, "shape": shape, "low": X.min(axis=0)}))
    np.testing.assert_array_equal(state["line"].predict(X[:, 0]), line.predict(X[:, 0]))
    np.testing.assert_array_equal(state["shape"].precision_, shape.precision_)
    np.testing.assert_array_equal(state["low"], X.min(axis=0))


@pytest.mark.parametrize("make", [trees, network])
def test_the_same_model_is_the_same_bytes_also_after_it_was_loaded(make: Callable[[], Any]) -> None:
    once, again = archive.dump({"model": make()}), archive.dump({"model": make()})
    assert once == again
    assert archive.dump(archive.load(once)) == once


def test_what_would_not_be_loaded_again_is_not_written() -> None:
    with pytest.raises(UnusableModel, match="ExtraTreesClassifier"):
        archive.dump({"model": ExtraTreesClassifier(2).fit(X, Y)})
    with pytest.raises(UnusableModel, match="Python objects"):
        archive.dump({"model": np.array(["a", None], dtype=object)})


class Runs:
    """Would run a program when unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, ("true",)


FORBIDDEN = {
    "posix.system": os.system,
    "builtins.eval": eval,
    "operator.methodcaller": operator.methodcaller("mkdir"),
    "operator.attrgetter": operator.attrgetter("__class__"),
    "functools.partial": functools.partial(os.system, "true"),
    "MethodNode": StandardScaler().fit,
    "builtins.bytes": b"bytes",
    "builtins.set": {1},
    "numpy.exp": np.exp,
    "FunctionTransformer": FunctionTransformer(np.exp),
}


@pytest.mark.parametrize("name", FORBIDDEN)
@pytest.mark.parametrize("nested", [False, True])
def test_a_type_that_is_not_on_our_list_is_named_and_refused(name: str, nested: bool) -> None:
    part = FORBIDDEN[name]
    data = skops.io.dumps({"a": [{"b": (1, part)}]} if nested else {"part": part})
    with pytest.raises(UnusableModel, match=re.escape(name)):
        archive.load(bytes(data))


def test_a_forbidden_type_within_a_model_is_refused() -> None:
    model = trees()
    model.harmless = functools.partial(os.system, "true")
    with pytest.raises(UnusableModel, match=r"functools\.partial"):
        archive.load(bytes(skops.io.dumps({"model": model})))


def test_keys_of_a_dictionary_are_made_by_nothing_but_str() -> None:
    def alter(schema: Any) -> None:
        schema["key_types"]["content"][0] |= {"__class__": "system", "__module__": "os"}

    with pytest.raises(UnusableModel, match=r"os\.system"):
        archive.load(altered(archive.dump({"true": 1}), alter))


@pytest.mark.parametrize(
    "how", ["ConstructorFromReduceNode", "MethodNode", "PartialNode", "CachedNode", "NoSuchNode"]
)
def test_an_allowed_type_made_in_another_way_is_refused(how: str) -> None:
    def alter(schema: Any) -> None:
        schema["content"]["model"]["__loader__"] = how

    with pytest.raises(UnusableModel, match=how):
        archive.load(altered(archive.dump({"model": StandardScaler().fit(X)}), alter))


def test_nothing_is_imported_for_a_file_that_is_refused(tmp_path: Path, monkeypatch: Any) -> None:
    (tmp_path / "trap.py").write_text(f"open({str(tmp_path / 'sprung')!r}, 'w')\nclass Trap: pass\n")
    monkeypatch.syspath_prepend(tmp_path)

    def alter(schema: Any) -> None:
        schema["content"]["model"] |= {"__module__": "trap", "__class__": "Trap"}

    with pytest.raises(UnusableModel, match=r"trap\.Trap"):
        archive.load(altered(archive.dump({"model": StandardScaler().fit(X)}), alter))
    assert not (tmp_path / "sprung").exists()


def test_a_pickle_is_not_opened() -> None:
    with pytest.raises(UnusableModel, match="pickle"):
        archive.load(pickle.dumps(Runs()))


@pytest.mark.parametrize("data", [b"", b"{}", b"PK\x03\x04", b"\x00" * 1000, b'{"format": 1}'])
def test_what_is_no_archive_is_refused(data: bytes) -> None:
    with pytest.raises(UnusableModel, match="no model file"):
        archive.load(data)


def test_every_truncation_is_refused() -> None:
    data = archive.dump({"model": StandardScaler().fit(X)})
    for length in range(0, len(data), 61):
        with pytest.raises(UnusableModel):
            archive.load(data[:length])


def test_a_damaged_file_is_refused_or_says_the_same() -> None:
    data = archive.dump({"scale": StandardScaler().fit(X), "low": X[0]})
    for place in range(0, len(data), 41):
        damaged = data[:place] + bytes([data[place] ^ 0xFF]) + data[place + 1 :]
        try:
            state = archive.load(damaged)
        except UnusableModel:
            continue
        np.testing.assert_array_equal(state["low"], X[0])


def test_a_zip_bomb_is_refused_before_it_unpacks() -> None:
    data = packed({SCHEMA: b" " * 5_000_000}, zipfile.ZIP_DEFLATED)
    with pytest.raises(UnusableModel, match="compressed"):
        archive.load(data)


def test_entries_that_share_their_bytes_are_refused() -> None:
    data = packed({SCHEMA: b"{}", "a": b"x" * 5000})
    at = data.index(b"PK\x01\x02", data.index(b"PK\x01\x02") + 1)
    record, end = data[at : data.index(b"PK\x05\x06")], data[data.index(b"PK\x05\x06") :]
    many = data[:at] + record * 50 + end[:8] + (51).to_bytes(2, "little") * 2
    many += (len(record) * 50 + at - data.index(b"PK\x01\x02")).to_bytes(4, "little") + end[16:]
    with pytest.raises(UnusableModel, match="larger than the whole file"):
        archive.load(many)


def test_a_file_that_is_too_large_is_refused() -> None:
    with pytest.raises(UnusableModel, match="at most"):
        archive.load(b"P" * (archive.MAX_BYTES + 1))


def test_an_array_that_claims_to_be_larger_than_it_is_is_refused() -> None:
    data = archive.dump({"low": np.zeros(10)})
    name, array = next((name, entry) for name, entry in entries(data).items() if name.endswith(".npy"))
    claimed = array.replace(b"(10,), }" + b" " * 9, b"(99999999999,), }")
    assert claimed != array
    with pytest.raises(UnusableModel, match="799999999992 bytes"):
        archive.load(packed(entries(data) | {name: claimed}))


def test_schemas_nested_without_end_are_refused() -> None:
    with pytest.raises(UnusableModel, match="nested too deep"):
        archive.load(packed({SCHEMA: b"[" * 1_000_000}))


@pytest.mark.parametrize("schema", [b"null", b"[]", b"{}", b'"x"', b"{", b"\xff", b'{"__loader__": {}}'])
def test_schemas_that_are_none_are_refused(schema: bytes) -> None:
    with pytest.raises(UnusableModel, match="damaged"):
        archive.load(packed({SCHEMA: schema}))


def test_another_version_of_scikit_learn_is_named() -> None:
    def alter(schema: Any) -> None:
        attributes = schema["content"]["scale"]["content"]["content"]
        attributes["_sklearn_version"]["content"] = '"1.2.3"'

    with pytest.raises(UnusableModel, match=r"scikit-learn 1\.2\.3"):
        archive.load(altered(archive.dump({"scale": StandardScaler().fit(X)}), alter))


def test_another_format_of_skops_is_refused() -> None:
    with pytest.raises(UnusableModel, match="format 0 of skops"):
        archive.load(altered(archive.dump({}), lambda schema: schema.update(protocol=0)))


def nodes(**changes: int) -> Any:
    """A model whose first tree's root has other numbers."""
    model = trees()
    for name, value in changes.items():
        model._predictors[0][0].nodes[name][0] = value
    return model


@pytest.mark.parametrize(
    "changes",
    [{"left": 1_000_000}, {"right": 0}, {"feature_idx": 77}, {"feature_idx": -1}, {"is_categorical": 1}],
)
def test_trees_that_lead_out_of_memory_are_refused(changes: dict[str, int]) -> None:
    data = archive.dump({"parts": [make_pipeline(StandardScaler().fit(X), nodes(**changes))]})
    with pytest.raises(UnusableModel, match="lead nowhere"):
        archive.load(data)


def test_a_state_is_a_dictionary() -> None:
    with pytest.raises(UnusableModel, match="a list instead of"):
        archive.load(bytes(skops.io.dumps([1])))
