from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from meshtide_codec.limits import FileLimits
from meshtide_codec.mesh_files.obj import materials
from meshtide_codec.mesh_files.obj.materials import parse_mtl, read_materials
from meshtide_codec.mesh_files.source import Source
from meshtide_codec.scene import Scene
from obj_files import read_bytes

CASES = Path(__file__).parent / "mesh_files"
FACE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
PNG = b"\x89PNG\r\n\x1a\nnot a picture"


def properties(text: str, folder: Path) -> dict[str, Any]:
    (folder / "a.mtl").write_text(f"newmtl a\n{text}", newline="")
    scene, _ = read_bytes(f"mtllib a.mtl\nusemtl a\n{FACE}", folder)
    return dict(scene.materials[0].properties)


def test_two_materials_keep_the_vertices_of_the_file() -> None:
    data = (CASES / "two_materials.obj").read_bytes()
    scene, notes = read_bytes(data, CASES)
    mesh = scene.geometries[0]
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert mesh.materials is not None
    assert mesh.materials.tolist() == [0, 1]
    assert [one.properties["pbrMetallicRoughness"]["baseColorFactor"] for one in scene.materials] == [
        [1, 0, 0, 1],
        [0, 1, 0, 1],
    ]
    assert notes == []


def test_a_missing_material_file_is_told_once(tmp_path: Path) -> None:
    scene, notes = read_bytes("mtllib no.mtl\nmtllib no.mtl\nusemtl a\n" + FACE + "usemtl b\nf 1 2 3\n", tmp_path)
    assert [material.name for material in scene.materials] == ["a", "b"]
    assert notes == ["material files that are missing: 1 ('no.mtl')"]


@pytest.mark.parametrize("reference", ["../a.mtl", "/etc/passwd", "sub/../../a.mtl", "..\\a.mtl", "."])
def test_files_elsewhere_are_never_read(reference: str, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "below" / "sub").mkdir(parents=True)
    scene, notes = read_bytes(f"mtllib {reference}\nusemtl a\n{FACE}", tmp_path / "below")
    assert dict(scene.materials[0].properties) == {}
    assert notes == [f"files that lie elsewhere or cannot be read, left out: 1 ({reference!r})"]


def test_a_link_that_leads_elsewhere_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 1 0 0\n")
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "a.mtl").symlink_to(tmp_path / "a.mtl")
    (tmp_path / "below" / "loop.mtl").symlink_to(tmp_path / "below" / "loop.mtl")
    scene, notes = read_bytes("mtllib a.mtl\nmtllib loop.mtl\nusemtl a\n" + FACE, tmp_path / "below")
    assert dict(scene.materials[0].properties) == {}
    assert len(notes) == 1


def test_a_file_alone_names_no_others() -> None:
    scene, notes = read_bytes("mtllib a.mtl\nusemtl a\n" + FACE)
    assert [material.name for material in scene.materials] == ["a"]
    assert notes == ["files that lie elsewhere or cannot be read, left out: 1 ('a.mtl')"]


def test_names_with_blanks_and_several_names_in_a_line(tmp_path: Path) -> None:
    (tmp_path / "my red.mtl").write_text("newmtl Material #25 \nKd 1 0 0\n")
    (tmp_path / "b.mtl").write_text("newmtl b\nKd 0 1 0\nnewmtl unused\n")
    text = f"mtllib my red.mtl\nmtllib b.mtl none.mtl\nusemtl Material #25 # the floor\n{FACE}usemtl b\nf 1 2 3\n"
    scene, notes = read_bytes(text, tmp_path)
    assert [material.name for material in scene.materials] == ["Material #25", "b", "unused"]
    colors = [one.properties["pbrMetallicRoughness"]["baseColorFactor"] for one in scene.materials]
    assert colors == [[1, 0, 0, 1], [0, 1, 0, 1], [1, 1, 1, 1]]
    assert notes == ["material files that are missing: 1 ('none.mtl')"]


@pytest.mark.parametrize(
    ("text", "color"),
    [
        ("Kd .1 .2 .3\nd 0.5\n", [0.1, 0.2, 0.3, 0.5]),
        ("\tKd\t.1  # grey\r\n\tTr 0.25\r\n", [0.1, 0.1, 0.1, 0.75]),
        ("Kd 1 0 0\rd 0.5\rTr 1", [1, 0, 0, 0.5]),
        ("Kd spectral file.rfl 1\nd -halo 0.5\n", [1, 1, 1, 1]),
        ("Kd nan 1 1\nd x\n", [1, 1, 1, 1]),
        ("Kd 1 2\n", [1, 1, 1, 1]),
    ],
)
def test_base_colors(text: str, color: list[float], tmp_path: Path) -> None:
    found = properties(text, tmp_path)
    assert found["pbrMetallicRoughness"] == {"baseColorFactor": color, "metallicFactor": 0.0}
    assert found.get("alphaMode") == ("BLEND" if color[3] < 1 else None)


def test_metal_roughness_emission_and_the_lines_themselves(tmp_path: Path) -> None:
    found = properties("Ns 10\nKe 1 0.5 0\nPm 1\nPr 0.25\nKe\n", tmp_path)
    assert found == {
        "pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 1.0, "roughnessFactor": 0.25},
        "emissiveFactor": [1, 0.5, 0],
        "mtl": ["Ns 10", "Ke 1 0.5 0", "Pm 1", "Pr 0.25", "Ke"],
    }


def textured(text: str, folder: Path) -> tuple[Scene, list[str]]:
    (folder / "a.mtl").write_text(text)
    return read_bytes(f"mtllib a.mtl\n{FACE}", folder)


def test_images_are_bytes_and_shared(tmp_path: Path) -> None:
    (tmp_path / "tex").mkdir()
    (tmp_path / "tex" / "wood grain.png").write_bytes(PNG)
    scene, notes = textured(
        "newmtl a\nmap_Kd -s 2 3 -o 0.5 tex\\wood grain.png\nnewmtl b\nmap_kd tex/wood grain.png\nnorm n.png\n",
        tmp_path,
    )
    first, second = (material.properties for material in scene.materials)
    transform = {"KHR_texture_transform": {"scale": [2.0, 3.0], "offset": [0.5, 0.0]}}
    assert first["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0, "extensions": transform}
    assert second["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}
    assert second["normalTexture"] == {"index": 1}
    assert scene.document == {"textures": [{"source": 0}, {"source": 1}]}
    assert [(image.name, image.data, image.mime_type) for image in scene.images] == [
        ("tex/wood grain.png", PNG, "image/png"),
        ("n.png", b"", ""),
    ]
    assert notes == ["images that are missing: 1 ('n.png')"]


def test_images_lie_beside_their_material_file_or_the_mesh(tmp_path: Path) -> None:
    (tmp_path / "m").mkdir()
    (tmp_path / "m" / "near.png").write_bytes(b"near")
    (tmp_path / "far.png").write_bytes(b"far")
    (tmp_path / "m" / "a.mtl").write_text("newmtl a\nmap_Kd near.png\nmap_Ke far.png\n")
    scene, notes = read_bytes(f"mtllib m/a.mtl\n{FACE}", tmp_path)
    assert [image.data for image in scene.images] == [b"near", b"far"]
    assert notes == []


def test_files_beyond_the_limits_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"x" * 2000)
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    scene, notes = read_bytes(f"mtllib a.mtl\n{FACE}", tmp_path, FileLimits(file_bytes=1000))
    assert scene.images[0].data == b""
    assert notes == ["files that lie elsewhere or cannot be read, left out: 1 ('a.png')"]


def test_many_names_of_files_are_not_all_looked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[str] = []
    monkeypatch.setattr(Source, "beside", lambda _self, reference, _limits: looked.append(reference))
    source = Source("a.obj", ".obj", b"", tmp_path)
    read_materials(source, FileLimits(), [f"{i}.mtl".encode() for i in range(1000)], [])
    assert len(looked) == materials._MOST_LIBRARIES
    assert source.notes[0].startswith("material files: 1000 are named, the first 64")
    library = "newmtl a\n" + "".join(f"map_Kd {i}.png\n" for i in range(3000))
    monkeypatch.setattr(
        Source, "beside", lambda _self, name, _limits: library.encode() if name == "a" else looked.append(name)
    )
    looked.clear()
    found = read_materials(source, FileLimits(), [b"a"], [])
    assert (len(looked), len(found.images)) == (materials._MOST_IMAGES, 3000)


@pytest.mark.skipif(os.name != "posix", reason="names of files are bytes there")
def test_names_that_are_not_utf_8_are_found(tmp_path: Path) -> None:
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/gr\xfcn.mtl")).write_bytes(b"newmtl \xfc\nmap_Kd \xfc.png\n")
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xfc.png")).write_bytes(PNG)
    scene, notes = read_bytes(b"mtllib gr\xfcn.mtl\nusemtl \xfc\n" + FACE.encode(), tmp_path)
    assert (scene.materials[0].name, scene.images[0].name, scene.images[0].data) == ("\ufffd", "\ufffd.png", PNG)
    assert scene.materials[0].properties["mtl"] == ["map_Kd \ufffd.png"]
    assert notes == []


def test_lines_before_the_first_material_and_repeated_ones() -> None:
    assert parse_mtl(b"Kd 1 1 1\nnewmtl a\nKd 1 0 0\nnewmtl a\nKd 0 1 0\nnewmtl\nd 1\n") == {
        b"a": ["Kd 1 0 0"],
        b"": ["d 1"],
    }
