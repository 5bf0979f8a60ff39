from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from meshes import grid
from meshtide_codec.errors import OptionError
from meshtide_codec.grid import Grid
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.own_streams import check_same_mesh, is_stream_of, stream_target
from streams import encoded_grid


@pytest.fixture(name="mesh_file")
def _mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "real.ply"
    save_mesh(grid(4), path)
    return path


def stream_of(mesh: Mesh, path: Path) -> Path:
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.encoder import encode

    path.write_bytes(encode(mesh, ClassicOptions(bits=8)).to_bytes())
    return path


def test_a_stream_is_known_by_the_cube_of_its_mesh(tmp_path: Path) -> None:
    mesh = grid(4)
    stream = stream_of(mesh, tmp_path / "a.tide")
    assert is_stream_of(stream, mesh)
    shifted = Mesh(mesh.vertices + 1e-3, mesh.faces)
    assert not is_stream_of(stream, shifted)
    assert not is_stream_of(stream, Mesh(mesh.vertices * 2, mesh.faces))
    rounded = Mesh(mesh.vertices.astype(np.float32).astype(np.float64), mesh.faces)
    assert is_stream_of(stream, rounded)
    loose = Mesh(np.vstack([mesh.vertices, [[9.0, 9.0, 9.0]]]), mesh.faces)
    assert is_stream_of(stream, loose)
    assert not is_stream_of(stream, Mesh(np.empty((0, 3)), np.empty((0, 3), np.int64)))


def test_on_a_chosen_grid_the_cube_tells_the_mesh_unless_tiles_share_its_origin(tmp_path: Path) -> None:
    from meshtide_codec.classic.options import ClassicOptions
    from meshtide_codec.encoder import encode

    mesh, stream = grid(4), tmp_path / "a.tide"
    stepped, shared = Grid(step=0.01), Grid(origin=(-9.0, -9.0, -9.0), extent=20.0)
    stream.write_bytes(encode(mesh, ClassicOptions(bits=8), grid=stepped).to_bytes())
    assert is_stream_of(stream, mesh, stepped)
    assert not is_stream_of(stream, mesh, Grid(step=0.02))
    assert not is_stream_of(stream, Mesh(mesh.vertices + 1.0, mesh.faces), stepped)
    stream.write_bytes(encode(mesh, ClassicOptions(bits=8), grid=shared).to_bytes())
    assert not is_stream_of(stream, mesh, shared)


def test_what_is_no_whole_header_is_a_stream_of_nothing(tmp_path: Path) -> None:
    whole = encoded_grid().to_bytes()
    for start in (b"", whole[:7], whole[:40], b"solid x", b"\x89TIDE\r\n\x1a" + bytes(100)):
        (tmp_path / "a.tide").write_bytes(start)
        assert not is_stream_of(tmp_path / "a.tide", grid(4))
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
    with pytest.raises(OptionError, match="the stream of another mesh"):
        check_same_mesh(stream_target(mesh_file, stream, overwrite=False), grid(4), overwrite=False)
    check_same_mesh(stream_target(mesh_file, stream, overwrite=True), grid(4), overwrite=True)


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
