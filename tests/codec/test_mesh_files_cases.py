"""Small files that mesh tools are known to misread, each with the right result; every one stands for a kind."""

from __future__ import annotations

import json
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from command_runner import meshtide
from meshtide_codec.errors import MeshError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_scene, mesh_of

CASES = Path(__file__).parent / "cases"
EXPECTED: dict[str, dict[str, object]] = json.loads((CASES / "expected.json").read_text())
BARE_ERRORS = ("Error:", "AssertionError", "list index", "unpack", "NoneType", "has no attribute", "invalid literal")
"""What a message looks like that a programming language, not a person, has written."""


def area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("name", [name for name, case in EXPECTED.items() if "vertices" in case])
def test_a_case_is_read_as_it_should_be(name: str) -> None:
    case = EXPECTED[name]
    loaded = mesh_of(load_scene(CASES / name), name)
    assert (len(loaded.mesh.vertices), len(loaded.mesh.faces)) == (case["vertices"], case["faces"])
    if "area" in case:
        assert area(loaded.mesh) == pytest.approx(case["area"], rel=1e-4)  # 16-bit positions


@pytest.mark.parametrize("name", [name for name, case in EXPECTED.items() if "error" in case])
def test_a_case_is_refused_by_name(name: str) -> None:
    with pytest.raises(MeshError) as raised:
        mesh_of(load_scene(CASES / name), name)
    assert str(EXPECTED[name]["error"]) in str(raised.value)
    assert not any(words in str(raised.value) for words in BARE_ERRORS)


@pytest.mark.parametrize(("name", "lost"), [("thin.ply", 1036), ("outlier.ply", 1665)])
def test_a_surface_that_the_grid_swallows_is_no_stream_and_the_best_b_is_told(
    name: str, lost: int, tmp_path: Path
) -> None:
    whole = meshtide("encode", CASES / name, "-o", tmp_path / "out.tide")
    assert isinstance(whole.exception, MeshError)
    assert f"vanish at B = 12; no B up to 20 keeps them, {lost} would go" in str(whole.exception)
    strict = meshtide("encode", CASES / name, "-o", tmp_path / "out.tide", "-B", "20", "--strict")
    assert isinstance(strict.exception, MeshError)
    assert list(tmp_path.iterdir()) == []
    coarse = meshtide("encode", CASES / name, "-o", tmp_path / "out.tide", "-B", "20")
    assert coarse.exit_code == 0
    assert f"quantization at B = 20 merges {lost} of" in coarse.stderr


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("ply_trail.ply", "17 bytes after the last row"),
        ("stl_trail.stl", "7 bytes follow the last facet"),
        ("ply_nan.ply", "not finite"),
        ("no_mtl.obj", "no material file"),
        ("noscene.gltf", "scene"),
        ("lines_beside.gltf", "line"),
        ("skin.gltf", "skin"),
        ("morph.gltf", "morph"),
    ],
)
def test_what_a_person_should_know_is_noted_once(name: str, words: str) -> None:
    notes = mesh_of(load_scene(CASES / name), name).notes
    assert sum(words in note for note in notes) == 1


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_a_library_that_is_missing_is_named_with_its_remedy(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for library in ("DracoPy", "PIL", "charset_normalizer", "meshoptimizer", "trimesh"):
        monkeypatch.setitem(sys.modules, library, None)
    if name == "draco.gltf":
        with pytest.raises(MeshError, match=r"KHR_draco_mesh_compression.*meshtide\[gltf\]"):
            load_scene(CASES / name)
    elif "error" in EXPECTED[name]:
        with pytest.raises(MeshError, match=str(EXPECTED[name]["error"])):
            load_scene(CASES / name)
    else:
        assert load_scene(CASES / name).geometries


def striped_obj(side: int, materials: int) -> bytes:
    """A grid of quadrilaterals whose stripes have materials of their own, as `usemtl` lines between faces."""
    rows = [f"v {j} {i} {i * j % 7}" for i in range(side + 1) for j in range(side + 1)]
    for material in range(materials):
        rows.append(f"usemtl m{material}")
        for i in range(side):
            for j in range(material * side // materials, (material + 1) * side // materials):
                a = i * (side + 1) + j + 1
                rows.append(f"f {a} {a + 1} {a + side + 2} {a + side + 1}")
    return "\n".join(rows).encode() + b"\n"


def peak_of_reading(path: Path) -> int:
    tracemalloc.start()
    try:
        load_scene(path)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_many_materials_cost_no_more_than_one(tmp_path: Path) -> None:
    peaks = []
    for count in (1, 50):
        path = tmp_path / f"{count}.obj"
        path.write_bytes(striped_obj(100, count))
        scene = load_scene(path)
        assert [len(one.vertices) for one in scene.geometries] == [101 * 101]
        assert len(scene.materials) == count
        peaks.append(peak_of_reading(path))
    assert peaks[1] < 1.3 * peaks[0]
