"""Rarer formats: what needs a library says so, archives are bounded, nothing of another library reaches the user."""

from __future__ import annotations

import io
import warnings
import zipfile
from typing import Any

import numpy as np
import pytest
import trimesh

from meshtide_codec.errors import MeshFileError, MissingLibraryError
from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files import other_formats
from meshtide_codec.mesh_files.other_formats import read_other, write_other
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Scene
from meshtide_codec.testing import tetrahedron

LIMITS = FileLimits(vertices=1000, faces=2000)


def source(kind: str, data: bytes = b"") -> Source:
    return Source(f"a.{kind}", f".{kind}", data)


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands for a library that reads dae: gives what `loaded` holds, or raises it."""

    class Library:
        loaded: Any = None

        def load(self, _file: io.BytesIO, **_options: Any) -> Any:
            np.float64(0) / np.float64(0)
            warnings.warn("of no use to anyone", UserWarning, stacklevel=2)
            if isinstance(self.loaded, Exception):
                raise self.loaded
            return self.loaded

    found = Library()
    monkeypatch.setattr(trimesh, "load", found.load)
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"dae", "3mf", "zip", "xyz"})
    return found


def mesh() -> trimesh.Trimesh:
    return trimesh.Trimesh(tetrahedron().vertices, tetrahedron().faces, process=False)


def test_positions_and_triangles_are_read_and_it_is_said(library: Any) -> None:
    for library.loaded in (mesh(), trimesh.Scene(mesh())):
        given = source("dae")
        found = read_other(given, LIMITS).mesh()
        assert found.vertices.tolist() == tetrahedron().vertices.tolist()
        assert found.faces.tolist() == tetrahedron().faces.tolist()
        assert given.notes == ["files named *.dae are read as positions and triangles: nothing else of them is kept"]


@pytest.mark.parametrize(
    ("loaded", "message"),
    [
        (KeyError("uri"), "trimesh cannot read it: it is damaged"),
        (AssertionError(), "trimesh cannot read it: it is damaged"),
        (trimesh.PointCloud(np.eye(3)), "there is no mesh in it, but points or lines"),
        (trimesh.Trimesh(np.zeros((1001, 3)), [[0, 1, 2]], process=False), "claims 1001 vertices"),
    ],
)
def test_what_it_cannot_read_is_refused_in_words(library: Any, loaded: Any, message: str) -> None:
    library.loaded = loaded
    with pytest.raises(MeshFileError, match=message):
        read_other(source("dae"), LIMITS)


def test_no_memory_is_no_fault_of_the_file(library: Any) -> None:
    library.loaded = MemoryError()
    with pytest.raises(MemoryError):
        read_other(source("dae"), LIMITS)


@pytest.mark.parametrize("kind", ["zip", "xyz", "tar.gz", "xyzzy", "obj2", "dxf"])
def test_what_is_no_mesh_format_is_not_tried(library: Any, kind: str) -> None:
    library.loaded = mesh()
    message = r"nothing is known about files named .*; obj, .* can be read, and with one more library each 3mf, 3dxml"
    with pytest.raises(MeshFileError, match=message):
        read_other(source(kind), LIMITS)


def test_a_library_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"obj"})
    with pytest.raises(MeshFileError, match=r"files named \*\.dae need a library: pip install 'meshtide\[formats\]'"):
        read_other(source("dae"), LIMITS)

    def missing(*_arguments: Any, **_options: Any) -> bytes:
        raise ImportError("missing")

    monkeypatch.setattr(trimesh.Trimesh, "export", missing)
    with pytest.raises(MissingLibraryError, match=r"named \*\.3mf need a library: pip install 'meshtide\[formats\]'"):
        write_other(Scene.of(tetrahedron()), "3mf")


def packed(size: int) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", bytes(size))
    return file.getvalue()


def test_an_archive_is_bounded_before_it_is_opened(library: Any) -> None:
    library.loaded = mesh()
    assert len(read_other(source("3mf", packed(1000)), LIMITS).mesh().faces) == 4
    library.loaded = AssertionError("opened")
    with pytest.raises(MeshFileError, match=f"the archive expands to more than {1 << 24} bytes"):
        read_other(source("3mf", packed(40_000_000)), LIMITS)
    with pytest.raises(MeshFileError, match="the archive is damaged"):
        read_other(source("3mf", packed(1000)[:-30]), LIMITS)


def test_what_is_written_is_what_the_library_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    for given in (b"bytes", "text"):
        monkeypatch.setattr(trimesh.Trimesh, "export", lambda _mesh, given=given, **_options: given)
        assert write_other(Scene.of(tetrahedron()), "dae") in {b"bytes", b"text"}
    assert set(other_formats.WRITTEN) <= set(other_formats._READ)
