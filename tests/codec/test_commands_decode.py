from __future__ import annotations

import json
from typing import TYPE_CHECKING

from command_runner import meshtide
from meshtide_codec.errors import (
    OptionError,
    TruncatedError,
)
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path


def test_a_coarser_level_can_be_decoded(stream_file: Path, tmp_path: Path) -> None:
    answer = json.loads(meshtide("decode", stream_file, "--level", 2, "-o", tmp_path / "c.ply", "--json").stdout)
    assert answer["level"] == 2
    assert answer["vertices"] < 256
    assert isinstance(meshtide("decode", stream_file, "--level", 50).exception, OptionError)


def test_a_cut_off_file_is_refused_or_gives_its_best_level(stream_file: Path, tmp_path: Path) -> None:
    cut = tmp_path / "cut.tide"
    cut.write_bytes(stream_file.read_bytes()[:-10])
    assert isinstance(meshtide("decode", cut).exception, TruncatedError)
    assert not cut.with_suffix(".decoded.ply").exists()
    result = meshtide("decode", cut, "--partial", "--json")
    answer = json.loads(result.stdout)
    assert answer["exact"] is False
    assert "ends after" in answer["problem"]
    assert cut.with_suffix(".decoded.ply").exists()
    assert isinstance(meshtide("info", cut).exception, TruncatedError)
    cut.write_bytes(stream_file.read_bytes()[:50])
    assert isinstance(meshtide("decode", cut, "--partial", "--overwrite").exception, TruncatedError)


def test_a_file_cut_off_behind_its_previews_gives_the_best_of_them(tmp_path: Path) -> None:
    save_mesh(grid(64), tmp_path / "patch.ply")
    report = json.loads(meshtide("encode", tmp_path / "patch.ply", "--previews", "256,32", "--json").stdout)
    after_base = report["levels"][2]
    assert after_base["rms"] > report["levels"][1]["rms"]
    whole = (tmp_path / "patch.tide").read_bytes()
    (tmp_path / "cut.tide").write_bytes(whole[: after_base["cumulative_bytes"]])
    answer = json.loads(meshtide("decode", tmp_path / "cut.tide", "--partial", "--json").stdout)
    assert answer["level"] == report["levels"][1]["level"]
