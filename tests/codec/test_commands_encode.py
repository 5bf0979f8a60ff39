from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.command_line import exit_code
from meshtide_codec.errors import (
    MeshError,
    OptionError,
)
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.stream.container import read_container
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path


def test_encode_then_decode(stream_file: Path, tmp_path: Path) -> None:
    result = meshtide("decode", stream_file, "-o", tmp_path / "out.obj", "--json")
    answer = json.loads(result.stdout)
    assert answer["level"] == 0
    assert answer["exact"] is True
    assert answer["problem"] is None
    assert len(load_mesh(tmp_path / "out.obj").vertices) == answer["vertices"] == 256


def test_encode_reports_what_it_left_out(tmp_path: Path) -> None:
    path = tmp_path / "odd.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 0 9\nv 0 0 0\nf 1 2 3\nf 5 2 3\n")
    answer = json.loads(meshtide("encode", path, "--json").stdout)
    assert (answer["unreferenced_vertices"], answer["welded_vertices"], answer["dropped_faces"]) == (1, 1, 1)
    kept = json.loads(meshtide("encode", path, "--json", "--keep-unreferenced").stdout)
    assert (kept["unreferenced_vertices"], kept["vertices"]) == (0, 4)
    text = meshtide("encode", path).stdout
    assert "1 vertices without a face, 1 welded, 1 faces" in text


@pytest.mark.parametrize(
    "options",
    [
        ["--filter", "zeroth"],
        ["--filter", "gaussian"],
        ["--filter", "taubin"],
        ["--degree", "5", "--basis", "chebyshev"],
        ["--norm", "inf"],
        ["--filter", "rational", "--degree", "1"],
        ["-S", "2"],
        ["--diff-levels", "0,1"],
        ["-K", "2"],
    ],
    ids=" ".join,
)
def test_every_option_of_the_codec_can_be_chosen(mesh_file: Path, options: list[str]) -> None:
    target = mesh_file.with_name("chosen.tide")
    result = meshtide("encode", mesh_file, "-o", target, "--profile", "classic", "--coarsest-vertices", 12, *options)
    assert result.exit_code == 0, result.output
    answer = json.loads(meshtide("decode", target, "--json").stdout)
    assert answer["vertices"] == 256


@pytest.mark.parametrize(
    "options",
    [
        ["--bits", "3"],
        ["--profile", "magic"],
        ["--slices", "0"],
        ["--previews", "a"],
        ["--degree", "3"],
        ["--profile", "classic", "--slices", "2"],
        ["--profile", "classic", "--filter", "magic"],
        ["--profile", "classic", "--diff-levels", "a"],
        ["--profile", "classic", "--norm", "3"],
        ["--profile", "classic", "-S", "0"],
    ],
    ids=" ".join,
)
def test_options_out_of_range_write_nothing(mesh_file: Path, options: list[str]) -> None:
    result = meshtide("encode", mesh_file, *options)
    assert isinstance(result.exception, OptionError)
    assert not mesh_file.with_suffix(".tide").exists()


@pytest.mark.parametrize("options", [[], ["--previews", "none"], ["--slices", "3"], ["-B", "9"]], ids=" ".join)
def test_the_compact_profile_is_the_default(mesh_file: Path, options: list[str]) -> None:
    answer = json.loads(meshtide("encode", mesh_file, "--json", *options).stdout)
    assert answer["profile"] == "compact"
    decoded = json.loads(meshtide("decode", answer["output"], "--json").stdout)
    assert decoded["vertices"] == 256
    assert decoded["exact"] is True
    assert "profile compact" in meshtide("info", answer["output"]).stdout
    assert isinstance(meshtide("info", answer["output"], "--statistics").exception, OptionError)


def test_the_order_of_the_input_can_be_kept(mesh_file: Path, tmp_path: Path) -> None:
    assert meshtide("encode", mesh_file, "-o", tmp_path / "kept.tide", "--store-order").exit_code == 0
    assert meshtide("decode", tmp_path / "kept.tide", "--input-order").exit_code == 0
    restored, original = load_mesh(tmp_path / "kept.decoded.ply"), load_mesh(mesh_file)
    assert (abs(restored.vertices - original.vertices) < 0.01).all()
    assert (restored.faces == original.faces).all()
    assert meshtide("encode", mesh_file, "-o", tmp_path / "lost.tide").exit_code == 0
    assert isinstance(meshtide("decode", tmp_path / "lost.tide", "--input-order").exception, OptionError)


def test_an_order_that_is_not_the_files_is_not_stored(tmp_path: Path) -> None:
    path = tmp_path / "odd.obj"
    path.write_text("v 0 0 0\nv nan 0 0\nv 1 0 0\nv 0 inf 0\nv 0 1 0\nf 1 3 5\n")
    error = meshtide("encode", path, "--store-order").exception
    assert type(error) is MeshError
    assert exit_code(error) == 3
    assert "odd.obj: vertex 1 is not finite" in str(error)
    assert "leave --store-order out" in str(error)
    assert not path.with_suffix(".tide").exists()
    assert "2 vertices are not finite" in json.loads(meshtide("encode", path, "--json").stdout)["notes"][0]


def test_a_grid_can_be_chosen(mesh_file: Path, tmp_path: Path) -> None:
    chosen = ["--origin", "-10,-10,-10", "--extent", "64"]
    assert meshtide("encode", mesh_file, "-o", tmp_path / "tile.tide", *chosen).exit_code == 0
    header, _ = read_container((tmp_path / "tile.tide").read_bytes())
    assert (header.origin, header.extent) == ((-10.0, -10.0, -10.0), 64.0)
    stepped = json.loads(meshtide("encode", mesh_file, "--step", "0.01", "--json").stdout)
    assert stepped["bits"] == 11
    for wrong in (["--step", "0.01", "-B", "12"], ["--origin", "1,2"], ["--step", "1e-9"], ["--extent", "-1"]):
        assert isinstance(meshtide("encode", mesh_file, *wrong).exception, OptionError)
    outside = meshtide("encode", mesh_file, "-o", tmp_path / "outside.tide", "--origin", "5,0,0")
    assert isinstance(outside.exception, MeshError)


def test_what_quantization_merges_is_told_and_refused_on_request(tmp_path: Path) -> None:
    patch = grid(30)
    narrow = tmp_path / "narrow.ply"
    save_mesh(Mesh(patch.vertices * [1, 1, 0.1], patch.faces), tmp_path / "wide.ply")
    save_mesh(Mesh(patch.vertices * [200, 1, 1], patch.faces), narrow)
    result = meshtide("encode", narrow, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["merged"]["keeping_bits"] > 12
    assert "warning: quantization at B = 12 merges" in result.stderr
    assert "merges" not in meshtide("encode", tmp_path / "wide.ply").stderr
    target = tmp_path / "strict.tide"
    refused = meshtide("encode", narrow, "--strict", "-o", target)
    assert isinstance(refused.exception, MeshError)
    assert not target.exists()


def test_a_mesh_whose_faces_all_vanish_is_refused(tmp_path: Path) -> None:
    patch = grid(30)
    save_mesh(Mesh(patch.vertices * [1, 1e-4, 0], patch.faces), tmp_path / "flat.ply")
    refused = meshtide("encode", tmp_path / "flat.ply")
    assert isinstance(refused.exception, MeshError)
    assert str(refused.exception).startswith("all 1682 faces vanish at B = 12; B = ")
    assert not (tmp_path / "flat.tide").exists()
