"""Buffers and views: in the file, in a URI, beside it; and those that are elsewhere, missing or too short."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gltf_files import TRIANGLE, read, triangle_file
from meshtide_codec.errors import MeshFileError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.gltf.buffers import Buffers
from meshtide_codec.mesh_files.gltf.document import Document
from meshtide_codec.mesh_files.source import Source

DATA = TRIANGLE.tobytes()
ENCODED = base64.b64encode(DATA).decode()


@pytest.mark.parametrize(
    "uri",
    [
        f"data:application/octet-stream;base64,{ENCODED}",
        f"data:;base64,{ENCODED}",
        f"data:application/gltf-buffer;BASE64,{ENCODED.rstrip('=')}",
        "DATA:;base64," + quote(ENCODED, safe=""),
        "data:application/octet-stream," + quote(DATA),
    ],
)
def test_data_uris_are_read(uri: str) -> None:
    assert np.array_equal(read(triangle_file().gltf(uri), ".gltf").mesh().vertices, TRIANGLE)


@given(st.binary(max_size=60), st.booleans())
def test_any_bytes_survive_a_data_uri(data: bytes, encoded: bool) -> None:
    uri = "data:;base64," + base64.b64encode(data).decode() if encoded else "data:," + quote(data)
    row = {"buffers": [{"byteLength": len(data), "uri": uri}]}
    buffers = Buffers(Document(row), None, Source("a.gltf", ".gltf", b""), FileLimits())
    assert buffers.buffer(0, "a view").tobytes() == data


@pytest.mark.parametrize("name", ["my data.bin", "100%.bin", "a%20b.bin", "käse.bin", "sub/a.bin"])
def test_files_beside_are_found_by_percent_encoded_names(tmp_path: Path, name: str) -> None:
    (tmp_path / "sub").mkdir()
    (tmp_path / name).write_bytes(DATA)
    scene = read(triangle_file().gltf(quote(name)), ".gltf", tmp_path)
    assert np.array_equal(scene.mesh().vertices, TRIANGLE)


def test_a_name_that_was_not_encoded_is_found_as_it_stands(tmp_path: Path) -> None:
    (tmp_path / "a%20b.bin").write_bytes(DATA)
    assert len(read(triangle_file().gltf("a%20b.bin"), ".gltf", tmp_path).mesh().faces) == 1


@pytest.mark.parametrize(
    ("uri", "message"),
    [
        ("../secret.bin", "outside of its folder"),
        ("%2e%2e/secret.bin", "outside of its folder"),
        ("..\\secret.bin", "outside of its folder"),
        ("/etc/passwd", "outside of its folder"),
        ("file:///etc/passwd", "only files beside a.gltf are read"),
        ("https://example.org/a.bin", "only files beside a.gltf are read"),
        ("C:\\secret.bin", "only files beside a.gltf are read"),
        ("link.bin", "outside of its folder"),
        ("missing.bin", r"buffers\[0\] is not there: the file 'missing.bin'"),
        ("sub", "not a regular file"),
        ("x" * 5000, "cannot be read"),
        ("a%00b", "no file can be called"),
        ("\ud800", "cannot be read: no file can be called so"),
        ("data:;base64", "data URI without data"),
        ("data:;base64,A", "not base64"),
        ("data:;base64,*()=", "not base64"),
        ("data:;base64,é", "not base64"),
        ("data:;base64,AAAA", "cut short: it claims 36 bytes, but holds 3"),
    ],
)
def test_what_is_elsewhere_or_missing_is_refused(tmp_path: Path, uri: str, message: str) -> None:
    folder = tmp_path / "folder"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "secret.bin").write_bytes(DATA)
    (folder / "link.bin").symlink_to(tmp_path / "secret.bin")
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file().gltf(uri), ".gltf", folder)


def test_links_in_a_circle_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.bin").symlink_to("b.bin")
    (tmp_path / "b.bin").symlink_to("a.bin")
    with pytest.raises(MeshFileError, match=r"a\.bin|buffers\[0\]"):
        read(triangle_file().gltf("a.bin"), ".gltf", tmp_path)


@pytest.mark.parametrize("suffix", [".glb", ".gltf"])
def test_a_file_without_a_folder_names_no_other(suffix: str) -> None:
    file = triangle_file(buffers=[{"byteLength": 36, "uri": "beside.bin"}])
    data = file.glb() if suffix == ".glb" else file.gltf("beside.bin")
    with pytest.raises(MeshFileError, match="names another one, 'beside.bin'"):
        read(data, suffix)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"buffers": [{"byteLength": 40}]}, r"buffers\[0\] is cut short: it claims 40 bytes, but holds 36"),
        ({"buffers": [{"byteLength": 1 << 40}]}, "claims 1099511627776 bytes"),
        ({"buffers": [{}]}, r"buffers\[0\] has no byteLength"),
        ({"buffers": [{"byteLength": 36, "uri": 3}]}, r"uri of buffers\[0\] is not a text"),
        ({"buffers": []}, r"names buffers\[0\]; the file has 0 buffers"),
        ({"bufferViews": []}, r"names bufferViews\[0\]"),
        ({"bufferViews": [{"buffer": 0}]}, r"bufferViews\[0\] has no byteLength"),
        ({"bufferViews": [{"buffer": 1, "byteLength": 36}]}, r"names buffers\[1\]"),
        (
            {"bufferViews": [{"buffer": 0, "byteOffset": 1, "byteLength": 36}]},
            r"bufferViews\[0\] lies outside of its buffer: it ends at byte 37, but buffers\[0\] has 36",
        ),
        (
            {"bufferViews": [{"buffer": 0, "byteOffset": (1 << 53) - 1, "byteLength": (1 << 53) - 1}]},
            "lies outside of its buffer",
        ),
    ],
)
def test_views_and_buffers_that_claim_too_much_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(MeshFileError, match=message):
        read(triangle_file(**changes))


def test_a_file_beside_is_opened_once_and_within_the_limit(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(DATA)
    rows = [{"byteLength": 36, "uri": "a.bin"}, {"byteLength": 12, "uri": "a.bin"}]
    buffers = Buffers(Document({"buffers": rows}), None, Source("a.gltf", ".gltf", b"", tmp_path), FileLimits())
    first, second = buffers.buffer(0, "x"), buffers.buffer(1, "x")
    assert np.shares_memory(first, second)
    assert (len(second), buffers.held()) == (12, 48)
    with pytest.raises(MeshFileError, match="claims 36 bytes; 35 are the most"):
        read(triangle_file().gltf("a.bin"), ".gltf", tmp_path, FileLimits(file_bytes=35))


def test_views_are_no_copies() -> None:
    row = {"buffers": [{"byteLength": 36}], "bufferViews": [{"buffer": 0, "byteOffset": 12, "byteLength": 12}]}
    buffers = Buffers(Document(row), memoryview(DATA), Source("a.glb", ".glb", DATA), FileLimits())
    assert np.shares_memory(buffers.view(0, "x"), np.frombuffer(DATA, np.uint8))
    assert buffers.view(0, "x").tobytes() == DATA[12:24]


def test_what_is_made_of_nothing_is_bounded() -> None:
    buffers = Buffers(Document({}), None, Source("a.glb", ".glb", bytes(1000)), FileLimits())
    buffers.take(1 << 24, "all that is free")
    with pytest.raises(MeshFileError, match="x makes 1 bytes, more than a file of 1000 bytes may"):
        buffers.take(1, "x")
