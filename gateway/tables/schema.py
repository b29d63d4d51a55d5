"""Structs as a JSON Schema, which editors complete TOML by: keys, what is allowed, and what each means."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
from msgspec import Struct

from gateway.tables.comments import comments

Schema = dict[str, Any]
DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"


def definitions(structs: Iterable[type[Struct]]) -> dict[str, Schema]:
    """Return each struct, and those that it is made of, by their names."""
    wanted = list(structs)
    _, found = msgspec.json.schema_components(wanted, schema_hook=_path, ref_template="#/$defs/{name}")
    for struct in wanted:
        said = comments(struct)
        properties = found[struct.__name__]["properties"]
        for name, one in properties.items():
            one.pop("description", None)
            if said.get(name):
                one["description"] = said[name].replace("None: ", "not given: ")
    return {name: _without_null(one) for name, one in sorted(found.items())}


def document(title: str, properties: Mapping[str, Schema], required: list[str], defs: Schema) -> Schema:
    """Return a whole file's."""
    return {
        "$schema": DIALECT,
        "title": title,
        "type": "object",
        "properties": dict(properties),
        "required": required,
        "additionalProperties": False,
        "$defs": defs,
    }


def ref(struct: type[Struct]) -> Schema:
    return {"$ref": f"#/$defs/{struct.__name__}"}


def named(one: Schema) -> Schema:
    """Tables of names, each such a one."""
    return {"type": "object", "additionalProperties": one}


def _path(kind: type) -> Schema:
    if kind is Path:
        return {"type": "string"}
    raise NotImplementedError(kind)


def _without_null(one: Any) -> Any:
    """TOML has no null: what may be one may be left out."""
    if isinstance(one, list):
        return [_without_null(part) for part in one]
    if not isinstance(one, dict):
        return one
    made = {key: _without_null(part) for key, part in one.items() if (key, part) != ("default", None)}
    choices = made.get("anyOf")
    if choices is not None and {"type": "null"} in choices:
        left = [part for part in choices if part != {"type": "null"}]
        del made["anyOf"]
        made = {**left[0], **made} if len(left) == 1 else {"anyOf": left, **made}
    return made
