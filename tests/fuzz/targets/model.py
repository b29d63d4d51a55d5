"""A model as a file: damaged, or with a schema of anything's making."""

import io
import zipfile

from ml.errors import UnusableModel
from ml.registry.archive import load

TOKENS = (
    b'"__class__": "dict"',
    b'"__module__": "builtins"',
    b'"__loader__": "DictNode"',
    b'"__loader__": "JsonNode"',
    b'"content": ',
    b'"key_types": ',
    b'"__loader__": "ListNode"',
    b'"protocol": 2',
    b'"type": "numpy"',
    b'"file": "a.npy"',
    b'"is_json": true',
    b'"__id__": 1',
    b'"__loader__": "CachedNode"',
    b'"__loader__": "ObjectNode"',
    b"[[[[",
)
MODULES = ("ml.registry.archive", "ml.registry.tree_checks")
_ARRAY = (
    bytes.fromhex("934e554d50590100") + b"\x76\0{'descr': '<f8', 'fortran_order': False, 'shape': (2,), }"
)
_ARRAY = _ARRAY.ljust(127) + b"\n" + bytes(16)


def fuzz(data: bytes) -> None:
    for content in (data, _with_schema(data)):
        try:
            assert isinstance(load(content), dict)
        except UnusableModel as error:
            assert str(error)


def _with_schema(schema: bytes) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("schema.json", schema)
        archive.writestr("a.npy", _ARRAY)
    return packed.getvalue()
