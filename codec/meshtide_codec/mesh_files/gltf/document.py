"""The JSON of a glTF file: read within bounds, its version checked; and values taken out of it, each one checked.

Nothing in it is believed: where the specification asks for a list, a number or an index, anything else is refused with
the place where it stands. Numbers that are whole may be written with a point.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import MeshFileError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from meshtide_codec.limits import FileLimits

Row = dict[str, Any]
LARGEST_LIST = 1 << 20
"""Rows of one list, such as nodes: far more than any scene has, few enough to go through."""
LARGEST_NUMBER = 1 << 53
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class Document:
    """The JSON of a glTF file, an object.

    Args:
        root: the object.
    """

    root: Row
    _lists: dict[str, list[Row]] = field(default_factory=dict)

    def rows(self, name: str) -> list[Row]:
        """One of its lists of objects, such as its nodes; empty where it has none.

        Raises:
            MeshFileError: it is not a list of objects, or endless.
        """
        if name not in self._lists:
            self._lists[name] = rows(self.root, name, "the file")
        return self._lists[name]

    def row(self, name: str, index: int, where: str) -> Row:
        """One row of such a list, which `where` names by its index.

        Raises:
            MeshFileError: there is none.
        """
        found = self.rows(name)
        if index >= len(found):
            raise MeshFileError(f"{where} names {name}[{index}]; the file has {len(found)} {name}")
        return found[index]


def parsed(text: bytes | memoryview, limits: FileLimits) -> Document:
    """Read the JSON of a glTF file of version 2.

    Raises:
        MeshFileError: it is too long, no JSON, no object, or of another version.
    """
    limits.check("json_bytes", len(text))
    plain = bytes(text).removeprefix(_BYTE_ORDER_MARK)
    try:
        # What is no JSON although Python reads it (NaN) becomes null, which is refused where a number matters.
        root = json.loads(plain.rstrip(b"\0 \t\r\n"), parse_constant=lambda _: None)
    except RecursionError as error:
        raise MeshFileError("the JSON is nested too deeply") from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise MeshFileError(f"the JSON cannot be read: {place} is not as JSON asks") from error
    except UnicodeDecodeError as error:
        raise MeshFileError(f"the JSON cannot be read: byte {error.start} is not text in {error.encoding}") from error
    except ValueError as error:
        raise MeshFileError("the JSON cannot be read: a number in it is too long") from error
    if not isinstance(root, dict):
        raise MeshFileError("the JSON is not an object, so this is not a glTF file")
    _check_version(root)
    return Document(root)


def _check_version(root: Row) -> None:
    asset = mapping(root, "asset", "the file")
    for key in ("version", "minVersion"):
        version = asset.get(key, "2.0")
        words = version.split(".") if isinstance(version, str) else []
        if not words or not all(word.isdecimal() and len(word) < 9 for word in words):
            raise MeshFileError(f"asset.{key} is not a version: {shown(version)}")
        newer = key == "minVersion" and int(words[0]) == 2 and any(int(word) for word in words[1:])
        if int(words[0]) != 2 or newer:
            raise MeshFileError(f"the file is of glTF {version}; version 2.0 is read. Convert it")


def shown(value: object) -> str:
    """A value as a message may hold it: short, in one line."""
    if isinstance(value, list | dict):
        return "a list" if isinstance(value, list) else "an object"
    return ascii(value[:50] if isinstance(value, str) else json.dumps(value)[:50])[1:-1]


def rows(row: Mapping[str, Any], key: str, where: str) -> list[Row]:
    """A list of objects; empty where the key is missing."""
    value = row.get(key, [])
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise MeshFileError(f"{key} of {where} is not a list of objects")
    if len(value) > LARGEST_LIST:
        raise MeshFileError(f"{where} has {len(value)} {key}; {LARGEST_LIST} are the most that is read")
    return value


def mapping(row: Mapping[str, Any], key: str, where: str) -> Row:
    """An object; empty where the key is missing."""
    value = row.get(key, {})
    if not isinstance(value, dict):
        raise MeshFileError(f"{key} of {where} is not an object: {shown(value)}")
    return value


def extension(row: Mapping[str, Any], name: str, where: str) -> Row | None:
    """The object of an extension, or None where the row has none of that name."""
    if "extensions" not in row:
        return None
    extensions = mapping(row, "extensions", where)
    return mapping(extensions, name, where) if name in extensions else None


def text(row: Mapping[str, Any], key: str) -> str:
    """A text that matters to people alone; empty where it is missing or something else."""
    value = row.get(key, "")
    return value if isinstance(value, str) else ""


def integer(row: Mapping[str, Any], key: str, where: str, default: int | None = None) -> int:
    """A number from 0 on.

    Raises:
        MeshFileError: it is something else, or missing where there is no default.

    >>> integer({"count": 3.0}, "count", "accessors[0]")
    3
    >>> integer({"count": -1}, "count", "accessors[0]")
    Traceback (most recent call last):
    ...
    meshtide_codec.errors.MeshFileError: count of accessors[0] is not a number from 0 on: -1
    """
    if key in row:
        return whole(row[key], key, where)
    if default is None:
        raise MeshFileError(f"{where} has no {key}")
    return default


def optional(row: Mapping[str, Any], key: str, where: str) -> int | None:
    """A number from 0 on, or None where it is missing."""
    return whole(row[key], key, where) if key in row else None


def whole(value: object, what: str, where: str) -> int:
    """The value, `what` of `where`, as a number from 0 on, if it is one."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    if type(value) is int and 0 <= value < LARGEST_NUMBER:  # no bool, which is an int as well
        return value
    raise MeshFileError(f"{what} of {where} is not a number from 0 on: {shown(value)}")


def integers(row: Mapping[str, Any], key: str, where: str) -> list[int]:
    """A list of numbers from 0 on; empty where the key is missing."""
    value = row.get(key, [])
    if not isinstance(value, list):
        raise MeshFileError(f"{key} of {where} is not a list: {shown(value)}")
    if set(map(type, value)) == {int} and min(value) >= 0 and max(value) < LARGEST_NUMBER:
        return value
    what = f"a value of {key}"
    return [whole(item, what, where) for item in value]


def numbers(row: Mapping[str, Any], key: str, where: str, default: Sequence[float] | None = None) -> list[float]:
    """A list of finite numbers, as many as the default has; of any length where there is no default."""
    if key not in row:
        return list(default or ())
    value = row[key]
    if not isinstance(value, list) or (default is not None and len(value) != len(default)):
        many = "numbers" if default is None else f"{len(default)} numbers"
        raise MeshFileError(f"{key} of {where} is not a list of {many}")
    return [_number(item, key, where) for item in value]


def _number(value: object, key: str, where: str) -> float:
    if (type(value) is float or type(value) is int) and -1e300 < value < 1e300:  # no bool, which is an int as well
        return float(value)
    raise MeshFileError(f"{key} of {where} holds what is not a finite number: {shown(value)}")


def names(row: Mapping[str, Any], key: str) -> list[str]:
    """A list of names; empty where the key is missing."""
    value = row.get(key, [])
    if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
        raise MeshFileError(f"{key} of the file is not a list of names")
    return value
