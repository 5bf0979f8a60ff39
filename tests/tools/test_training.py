"""The scripts that train: from a small mesh they make files like those that the package ships."""

from __future__ import annotations

import runpy
import sys
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from meshtide_codec.connectivity import tables
from octrees import torus

TOOLS = Path(__file__).parents[2] / "tools"
PACKAGE = resources.files("meshtide_codec")


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    """A torus of two hundred vertices as an OFF file."""
    octree = torus(20, 10, 8)
    faces = octree.levels[-1].faces
    assert faces is not None
    lines = [f"OFF\n{len(octree.positions)} {len(faces)} 0"]
    lines += [" ".join(map(str, row)) for row in octree.positions.tolist()]
    lines += [" ".join(map(str, (3, *row))) for row in faces.tolist()]
    path = tmp_path / "torus.off"
    path.write_text("\n".join(lines) + "\n")
    return path


def run(script: str, *arguments: object, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [script, *map(str, arguments)])
    monkeypatch.syspath_prepend(str(TOOLS))
    runpy.run_path(str(TOOLS / script), run_name="__main__")


def described(path: Path) -> dict[str, tuple[np.dtype[np.generic], tuple[int, ...]]]:
    with np.load(path) as arrays:
        return {name: (array.dtype, array.shape) for name, array in arrays.items() if array.dtype.kind in "iu"}


@pytest.mark.parametrize(
    ("script", "file"),
    [("train_geometry.py", "geometry_states.npz"), ("train_deep.py", "deep_states.npz")],
)
def test_geometry_states(
    script: str, file: str, mesh_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = tmp_path / file
    run(script, "--output", made, mesh_file, monkeypatch=monkeypatch)
    with resources.as_file(PACKAGE / "compact" / file) as shipped:
        assert described(made) == described(shipped)
    with np.load(made) as arrays:
        assert (arrays["map_probabilities"] != 1 << 15).any()
        assert (arrays["diff_weights"] != arrays["diff_weights"][0]).any()


def test_connectivity_tables(mesh_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = {geometric: Path(str(tables.table_path(geometric=geometric))) for geometric in (False, True)}
    monkeypatch.setattr(tables, "table_path", lambda *, geometric: tmp_path / f"{geometric}.npz")
    monkeypatch.syspath_prepend(str(TOOLS))
    import train_connectivity

    for constant, value in (("ASSEMBLIES", 0), ("MOST_ROWS", 100_000), ("ROUNDS", 1)):
        monkeypatch.setattr(train_connectivity, constant, value)
    monkeypatch.setattr(sys, "argv", ["train_connectivity.py", str(mesh_file)])
    train_connectivity.main()
    for geometric, path in shipped.items():
        assert described(tmp_path / f"{geometric}.npz") == described(path)
        with np.load(tmp_path / f"{geometric}.npz") as arrays:
            assert arrays["meshes"].tolist() == ["torus.off"]
            assert arrays["scores"].any()


def test_deep_connectivity_tables(mesh_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shipped = tables.deep_table_path()
    monkeypatch.setattr(tables, "deep_table_path", lambda: tmp_path / "deep.npz")
    monkeypatch.syspath_prepend(str(TOOLS))
    import train_connectivity
    import train_deep_connectivity

    monkeypatch.setattr(train_connectivity, "PARTS", 4)
    monkeypatch.setattr(sys, "argv", ["train_deep_connectivity.py", "--rotations", "2", str(mesh_file)])
    train_deep_connectivity.main()
    assert described(tmp_path / "deep.npz") == described(shipped)
    with np.load(tmp_path / "deep.npz") as arrays:
        assert arrays["meshes"].tolist() == ["torus.off", "assembly 0", "assembly 1"]
        assert arrays["scores"].any()
        assert arrays["counts"].any()
