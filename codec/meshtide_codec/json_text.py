"""JSON that every reader takes, whatever the names in it are made of."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

from meshtide_codec.printable import encodable


def json_text(value: object, *, indent: int | None = None) -> str:
    r"""`value` as JSON in ASCII; bytes of names that are not UTF-8 are shown as backslash escapes.

    Lone surrogates are legal in Python's JSON, and an error in most other readers.

    >>> json_text({"file": "caf\udce9.ply", "bytes": 1})
    '{"file": "caf\\\\udce9.ply", "bytes": 1}'
    """
    return json.dumps(_encodable(value), indent=indent)


def _encodable(value: object) -> object:
    if isinstance(value, str):
        return encodable(value)
    if isinstance(value, Mapping):
        return {_encodable(key): _encodable(item) for key, item in value.items()}
    if isinstance(value, Sequence):
        return [_encodable(item) for item in value]
    return value
