"""Damage to files, as the fuzzers do it: other bytes, other words of a text, other values in the JSON of a GLB file."""

from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import random

_NUMBERS = (
    *("nan", "inf", "-inf", "1e400", "-1e-400", "-1", "0", "1", "3", "4294967295", "2147483648", "1e308", "999999999"),
    *("18446744073709551616", "-9223372036854775808", "0x10", "1_0", "\u0663", "", "1.5", "a"),
)
_VALUES: tuple[object, ...] = (
    None,
    True,
    -1,
    0,
    1,
    2,
    1.5,
    2**31,
    2**53,
    2**64,
    float("inf"),
    "",
    "VEC3",
    "x" * 300,
    [],
    [[]],
    {},
    [0, 0],
)


def damaged(pick: random.Random, suffix: str, body: bytes) -> bytes:
    """A file with one to three faults, of the kinds that its format can have.

    Args:
        pick: where all chance comes from.
        suffix: which names the format.
        body: of the file.
    """
    for _ in range(pick.randrange(1, 4)):
        kind = pick.random()
        if suffix in {".glb", ".gltf"} and kind < 0.6:
            body = other_json(pick, body) if suffix == ".glb" else other_value(pick, body)
        elif suffix != ".tide" and kind < 0.5:
            body = other_words(pick, body)
        else:
            body = other_bytes(pick, body)
    return body


def other_bytes(pick: random.Random, body: bytes) -> bytes:
    """Some bytes changed, gone, doubled, or the end cut off."""
    data = bytearray(body)
    place = pick.randrange(len(data) + 1)
    length = pick.choice((1, 2, 4, 12, 50, 1000))
    match pick.randrange(5):
        case 0:
            for _ in range(pick.choice((1, 1, 5, 100)) if data else 0):
                data[pick.randrange(len(data))] = pick.randrange(256)
        case 1:
            del data[place : place + length]
        case 2:
            data[place:place] = data[place : place + length]
        case 3:
            data[place:place] = pick.randbytes(length)
        case _:
            del data[place:]
    return bytes(data)


def other_words(pick: random.Random, body: bytes) -> bytes:
    """Words of a text file, or of a header, replaced by odd numbers; or lines in another order."""
    lines = body.split(b"\n")
    index = pick.randrange(min(len(lines), pick.choice((12, len(lines)))))
    if pick.random() < 0.2:
        other = pick.randrange(len(lines))
        lines[index], lines[other] = lines[other], lines[index]
        return b"\n".join(lines)
    words = lines[index].split(b" ")
    words[pick.randrange(len(words))] = pick.choice(_NUMBERS).encode()
    lines[index] = b" ".join(words)
    return b"\n".join(lines)


def other_json(pick: random.Random, body: bytes) -> bytes:
    """A GLB file of which one value of its JSON is another one; its frame is right."""
    try:
        length = struct.unpack_from("<I", body, 12)[0]
        text = other_value(pick, body[20 : 20 + length])
    except struct.error:
        return other_bytes(pick, body)
    text += b" " * (-len(text) % 4)
    rest = body[20 + length :]
    head = struct.pack("<4sIII4s", b"glTF", 2, 20 + len(text) + len(rest), len(text), b"JSON")
    return head + text + rest


def other_value(pick: random.Random, text: bytes) -> bytes:
    """JSON of which one value is another one, or missing; other bytes where it is no JSON any more."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return other_bytes(pick, text)
    holder, key = pick.choice([*_places(document)] or [({"asset": 0}, "asset")])
    if pick.random() < 0.2:
        del holder[key]
    else:
        holder[key] = pick.choice(_VALUES)
    return json.dumps(document).encode()


def _places(value: Any) -> list[tuple[Any, Any]]:
    """Every place in a JSON document where a value stands."""
    keys = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    return [place for key in keys for place in ((value, key), *_places(value[key]))]
