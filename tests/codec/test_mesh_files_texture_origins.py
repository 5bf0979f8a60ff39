"""Texture coordinates from one format to another: v is turned round once between glTF and the others, and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gltf_files import GltfFile
from meshtide_codec.attributes import Domain, Kind, origin_of, with_origin
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_scene, save_scene

UV = np.array([[0.0, 0.125], [1.0, 0.3], [0.25, 1.0]], np.float32)
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.0 0.125\nvt 1.0 0.25\nvt 0.25 -0.5\nf 1/1 2/2 3/3\n"


def corner_values(mesh: Mesh, origin: str = "lower left") -> np.ndarray:
    """Texture coordinates (m, 3, 2) of the corners, from an origin."""
    one = next(with_origin(each, origin) for each in mesh.attributes if each.kind is Kind.TEXCOORD)
    rows = one.rows()[mesh.faces] if one.domain is Domain.VERTEX else one.rows().reshape(-1, 3)
    return one.values[rows].astype(np.float64)


def stored(path: Path) -> np.ndarray:
    """The numbers that a file has for the corners, whatever they count from."""
    mesh = load_scene(path).mesh()
    one = next(each for each in mesh.attributes if each.kind is Kind.TEXCOORD)
    return corner_values(mesh, origin_of(one))


@pytest.mark.parametrize("other", ["obj", "off", "ply"])
@pytest.mark.parametrize("kind", ["glb", "gltf"])
def test_v_is_turned_once_from_gltf_and_back(tmp_path: Path, other: str, kind: str) -> None:
    file = GltfFile()
    attributes = {"POSITION": file.accessor([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")}
    file.mesh({"attributes": attributes | {"TEXCOORD_0": file.accessor(UV, "<f4")}})
    (tmp_path / "a.glb").write_bytes(file.shown({"mesh": 0}).glb())
    scene = load_scene(tmp_path / "a.glb")
    assert np.array_equal(stored(tmp_path / "a.glb")[0], UV)
    assert save_scene(scene, tmp_path / f"b.{other}") == ()
    turned = np.stack([UV[:, 0].astype(float), 1 - UV[:, 1].astype(float)], axis=1)
    assert np.array_equal(stored(tmp_path / f"b.{other}")[0], turned)
    again = load_scene(tmp_path / f"b.{other}")
    assert np.array_equal(corner_values(again.mesh()), corner_values(scene.mesh()))
    save_scene(again, tmp_path / f"c.{kind}")
    assert np.array_equal(stored(tmp_path / f"c.{kind}")[0], UV)


@pytest.mark.parametrize("other", ["glb", "gltf"])
def test_v_is_turned_once_from_obj_and_back(tmp_path: Path, other: str) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    scene = load_scene(tmp_path / "a.obj")
    save_scene(scene, tmp_path / f"b.{other}")
    assert stored(tmp_path / f"b.{other}").tolist() == [[[0, 0.875], [1, 0.75], [0.25, 1.5]]]
    again = load_scene(tmp_path / f"b.{other}")
    assert np.array_equal(corner_values(again.mesh()), corner_values(scene.mesh()))
    save_scene(again, tmp_path / "c.obj")
    assert [line for line in (tmp_path / "c.obj").read_text().splitlines() if line.startswith("vt")] == [
        "vt 0.0 0.125",
        "vt 1.0 0.25",
        "vt 0.25 -0.5",
    ]


def test_v_stays_between_formats_that_count_alike(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OBJ)
    for kind in ("off", "ply", "obj"):
        save_scene(load_scene(tmp_path / "a.obj"), tmp_path / f"b.{kind}")
        assert np.array_equal(stored(tmp_path / f"b.{kind}"), stored(tmp_path / "a.obj"))
