from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec import own_streams
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.encoder import encode
from meshtide_codec.errors import OptionError
from meshtide_codec.grid import Grid
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.own_streams import (
    check_same_mesh,
    default_mesh,
    default_stream,
    has_cube_of,
    is_stream_of,
    stream_target,
)
from meshtide_codec.testing import grid, random_meshes
from streams import encoded_grid


@pytest.fixture(name="mesh_file")
def _mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "real.ply"
    save_mesh(grid(4), path)
    return path


def stream_of(mesh: Mesh, path: Path, chosen: Grid | None = None) -> Path:
    path.write_bytes(encode(mesh, ClassicOptions(bits=8), grid=chosen).to_bytes())
    return path


def in_unit_box(mesh: Mesh) -> Mesh:
    corner, opposite = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return Mesh((mesh.vertices - corner) / (opposite - corner), mesh.faces)


def test_a_cube_is_known_with_and_without_loose_vertices(tmp_path: Path) -> None:
    mesh = grid(4)
    stream = stream_of(mesh, tmp_path / "a.tide")
    assert has_cube_of(stream, mesh)
    shifted = Mesh(mesh.vertices + 1e-3, mesh.faces)
    assert not has_cube_of(stream, shifted)
    assert not has_cube_of(stream, Mesh(mesh.vertices * 2, mesh.faces))
    rounded = Mesh(mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces)
    assert has_cube_of(stream, rounded)
    loose = Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0], [np.nan, 0.0, 0.0]]]), mesh.faces)
    assert has_cube_of(stream, loose)
    assert not has_cube_of(stream, Mesh(np.empty((0, 3)), np.empty((0, 3), np.int64)))


@pytest.mark.parametrize(
    "chosen", [Grid(step=0.01), Grid((-9.0, -9.0, -9.0), 20.0), Grid(extent=9.0), Grid((-9.0, -9.0, -9.0))], ids=str
)
def test_the_cube_may_be_the_grid_that_was_asked_for(tmp_path: Path, chosen: Grid) -> None:
    mesh, stream = grid(4), stream_of(grid(4), tmp_path / "a.tide", chosen)
    assert has_cube_of(stream, mesh, chosen)
    assert not has_cube_of(stream, mesh)
    assert not has_cube_of(stream, mesh, Grid(step=0.02))
    assert has_cube_of(stream_of(mesh, stream), mesh, chosen)  # of an earlier run without a grid
    assert is_stream_of(stream_of(mesh, stream, chosen), mesh)


def test_a_stream_decodes_to_the_very_mesh(tmp_path: Path) -> None:
    mesh = grid(4)
    stream = stream_of(mesh, tmp_path / "a.tide")
    moved = mesh.vertices.copy()
    moved[5, 2] += 0.03  # more than a step inside of the cube
    cut = Mesh(mesh.vertices, mesh.faces[:-1])
    turned = Mesh(mesh.vertices, np.vstack([mesh.faces[:-1], mesh.faces[-1:, ::-1]]))
    loose = Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0], [np.nan, 0.0, 0.0]]]), mesh.faces)
    assert [is_stream_of(stream, each) for each in (mesh, loose)] == [True, True]
    others = (Mesh(moved, mesh.faces), cut, turned, Mesh(mesh.vertices + 1.0, mesh.faces), grid(4, seed=1))
    assert not any(is_stream_of(stream, each) for each in others)
    kept = Mesh(np.vstack([mesh.vertices, [[1.0, 1.0, 0.5]]]), mesh.faces)
    assert is_stream_of(stream_of(kept, stream), kept)
    assert not is_stream_of(stream, mesh)


def test_only_a_stream_whose_counts_fit_is_decoded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = stream_of(grid(4), tmp_path / "a.tide")
    decoded: list[Path] = []
    monkeypatch.setattr(own_streams, "_decoded", decoded.append)
    assert not is_stream_of(stream, grid(5))
    assert not is_stream_of(stream, Mesh(grid(4).vertices + 1.0, grid(4).faces))
    assert decoded == []
    assert not is_stream_of(stream, grid(4))
    assert decoded == [stream]


def test_a_stream_that_is_damaged_or_cut_off_is_of_no_mesh(tmp_path: Path) -> None:
    whole = stream_of(grid(4), tmp_path / "a.tide").read_bytes()
    for content in (whole[:-1], whole[:-1] + bytes([whole[-1] ^ 1]), whole + b"x"):
        (tmp_path / "a.tide").write_bytes(content)
        assert not is_stream_of(tmp_path / "a.tide", grid(4))


@given(mesh=random_meshes(12), bits=st.integers(4, 10))
def test_every_mesh_knows_its_own_stream(tmp_path_factory: pytest.TempPathFactory, mesh: Mesh, bits: int) -> None:
    stream = tmp_path_factory.mktemp("own") / "a.tide"
    encoded = encode(mesh, ClassicOptions(bits=bits))
    stream.write_bytes(encoded.to_bytes())
    assert is_stream_of(stream, mesh)
    assert has_cube_of(stream, mesh)


def test_what_is_no_whole_header_is_a_stream_of_nothing(tmp_path: Path) -> None:
    whole = encoded_grid().to_bytes()
    for start in (b"", whole[:7], whole[:40], b"solid x", b"\x89TIDE\r\n\x1a" + bytes(100)):
        (tmp_path / "a.tide").write_bytes(start)
        assert not is_stream_of(tmp_path / "a.tide", grid(4))
        assert not has_cube_of(tmp_path / "a.tide", grid(4))
    assert not is_stream_of(tmp_path / "missing.tide", grid(4))


def test_an_earlier_stream_may_be_made_anew_and_nothing_else(mesh_file: Path) -> None:
    stream = mesh_file.with_suffix(".tide")
    assert not stream_target(mesh_file, None, overwrite=False).replace
    stream.write_bytes(b"notes")
    with pytest.raises(OptionError, match="there already"):
        stream_target(mesh_file, None, overwrite=False)
    assert stream_target(mesh_file, None, overwrite=True).replace
    stream_of(grid(4), stream)
    target = stream_target(mesh_file, None, overwrite=False)
    check_same_mesh(target, grid(4), overwrite=False)
    stream_of(grid(5), stream)
    for by_name in (False, True):
        with pytest.raises(OptionError, match="there already, and is not a whole stream of this very mesh"):
            check_same_mesh(
                stream_target(mesh_file, stream, overwrite=False), grid(4), by_name=by_name, overwrite=False
            )
    check_same_mesh(stream_target(mesh_file, stream, overwrite=True), grid(4), overwrite=True)


def test_meshes_that_fill_one_box_are_taken_for_one_under_the_default_name_only(mesh_file: Path) -> None:
    one, other = in_unit_box(grid(4)), in_unit_box(grid(4, seed=1))
    target = stream_target(mesh_file, stream_of(one, mesh_file.with_suffix(".tide")), overwrite=False)
    check_same_mesh(target, other, by_name=True, overwrite=False)
    check_same_mesh(target, one, overwrite=False)
    with pytest.raises(OptionError, match="not a whole stream of this very mesh"):
        check_same_mesh(target, other, overwrite=False)


@pytest.mark.parametrize("other", ["real.obj", "real.STL", "real.ply.gz"])
def test_two_files_that_lead_to_one_stream_are_both_named(mesh_file: Path, other: str) -> None:
    (mesh_file.parent / other).write_bytes(mesh_file.read_bytes())
    stream = stream_of(grid(4), mesh_file.with_suffix(".tide"))
    with pytest.raises(
        OptionError, match=rf"real\.tide is there already, and .*real\.ply and .*{other} both become it"
    ):
        stream_target(mesh_file, None, overwrite=False)
    assert stream_target(mesh_file, stream, overwrite=False).replace


def test_the_source_is_never_its_own_stream(tmp_path: Path) -> None:
    source = tmp_path / "real.tide"
    source.write_bytes(b"a mesh with a strange name")
    with pytest.raises(OptionError, match="is what is read"):
        stream_target(source, None, overwrite=True)


def test_what_comes_from_standard_input_goes_to_standard_output() -> None:
    assert stream_target(Path("-"), None, overwrite=False).is_standard_output


@pytest.mark.parametrize("name", [".", "/"])
def test_what_can_only_be_a_folder_has_no_file_beside_it(name: str) -> None:
    with pytest.raises(IsADirectoryError):
        default_stream(Path(name))
    with pytest.raises(IsADirectoryError):
        default_mesh(Path(name), "ply")
