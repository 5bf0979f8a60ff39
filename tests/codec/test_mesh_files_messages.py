"""What readers say of hostile files is in words of their own, not in Python's or a library's."""

from __future__ import annotations

import gzip
import json
import re
import struct
from typing import TYPE_CHECKING

import pytest

from meshtide_codec.errors import MeshFileError
from meshtide_codec.mesh_files.read import load_scene

if TYPE_CHECKING:
    from pathlib import Path

FOREIGN = re.compile(
    r"Error|Exception|recursion|codec can't|decompress|unpack requires|Expecting|Traceback|NoneType|dict\b|\bnot "
    r"(?:subscriptable|iterable)|unsupported operand|out of bounds|broadcast|dtype|ndarray|zlib|struct\.|int too large|"
    r"string conversion|surrogates|invalid literal|could not convert"
)
ASSET = '{"asset":{"version":"2.0"}'


def glb(text: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text), len(text), 0x4E4F534A) + text


JSON_TEXTS = {
    "nested lists": (b"[" * 200_000, "the JSON is nested too deeply"),
    "nested objects": (b'{"a":' * 200_000, "the JSON is nested too deeply"),
    "nothing": (b"", "it is empty|line 1, column 1 is not as JSON asks"),
    "a word": (b'{\n"asset": x}', "line 2, column 10 is not as JSON asks"),
    "no text": (b'{"a": "\xff"}', "byte 7 is not text"),
    "a very long number": (b'{"a": ' + b"9" * 5000 + b"}", "a number in it is too long"),
    "a list": (b"[1]", "not an object"),
    "an object for a version": (b'{"asset": {"version": {}}}', "not a version: an object"),
    "nothing for meshes": (ASSET.encode() + b',"meshes":null}', "not a list of objects"),
    "a huge count": (
        f'{ASSET},"accessors":[{{"count":1e308,"componentType":5126,"type":"VEC3"}}],"meshes":[{{"primitives":'
        '[{"attributes":{"POSITION":0}}]}],"nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}]}'.encode(),
        "count of accessors",
    ),
}
FILES = {
    "a damaged archive": ("a.obj.gz", gzip.compress(b"v 0 0 0\n")[:10] + b"\xff" * 20, "the archive is damaged"),
    "an archive packed twice": ("a.obj.gz", gzip.compress(gzip.compress(b"v 0 0 0\n")), "gzip archive"),
    "an archive of nothing": ("a.obj.gz", gzip.compress(b""), "it is empty"),
    "a damaged zip archive": ("a.3mf", b"PK\x03\x04" + bytes(50), "archive is damaged|need a library"),
    "a number of PLY": ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 1e99\nend_header\n", "not understood"),
    "rows of PLY": (
        "a.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex " + b"9" * 18 + b"\nproperty float x\nend_header\n",
        "vertices",
    ),
    "a number of OFF": ("a.off", b"OFF\n1 1 0\nx y z\n3 0 0 0\n", "number is missing"),
    "a corner of OFF": ("a.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 1e300\n", "whole number"),
    "a corner of OBJ": ("a.obj", b"v 0 0 0\nf 1 1 " + b"9" * 40 + b"\n", "line 2"),
    "a surrogate of OBJ": ("a.obj", b"\xff\xfev\0 \0\x00\xd8\n\0", "line 1"),
    "a short STL": ("a.stl", b"\xff" * 90, "cut short"),
    "a short GLB": ("a.glb", b"glTF\2\0\0\0", "cut short"),
    "an unknown kind": ("a.xyz", b"1 2 3", "nothing is known"),
}


@pytest.mark.parametrize("case", FILES)
def test_messages_on_hostile_files(case: str, tmp_path: Path) -> None:
    name, data, expected = FILES[case]
    check(tmp_path / name, data, expected)


@pytest.mark.parametrize("case", JSON_TEXTS)
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_messages_on_hostile_json(case: str, name: str, tmp_path: Path) -> None:
    text, expected = JSON_TEXTS[case]
    check(tmp_path / name, glb(text) if name.endswith("glb") else text, expected)


@pytest.mark.parametrize("uri", ["data:;base64,%%%", "data:", "a\0b", "\ud800", "x" * 5000, "../../a.bin", "a.bin", ""])
def test_messages_on_hostile_references(uri: str, tmp_path: Path) -> None:
    primitive = {"primitives": [{"attributes": {"POSITION": 0}}]}
    root = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": 36, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "count": 3, "componentType": 5126, "type": "VEC3"}],
        "meshes": [primitive],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
    }
    check(tmp_path / "a.gltf", json.dumps(root).encode(), "buffers.0.|names")


def check(path: Path, data: bytes, expected: str) -> None:
    path.write_bytes(data)
    with pytest.raises(MeshFileError, match=expected) as raised:
        load_scene(path)
    message = str(raised.value).removeprefix(str(path))
    assert FOREIGN.search(message) is None
