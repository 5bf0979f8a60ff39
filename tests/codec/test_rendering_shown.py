from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import encode
from meshtide_codec.errors import ContainerError, OptionError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.rendering.picture import Subject
from meshtide_codec.rendering.shown import coloured_by_distance, load_subjects
from meshtide_codec.testing import grid, shapes

if TYPE_CHECKING:
    from pathlib import Path


def test_files_samples_and_streams_are_shown(tmp_path: Path) -> None:
    save_mesh(grid(6), tmp_path / "patch.ply")
    encoded = encode(grid(16), CompactOptions(bits=8))
    (tmp_path / "patch.tide").write_bytes(encoded.to_bytes())
    subjects = load_subjects([str(tmp_path / "patch.ply"), "spot", str(tmp_path / "patch.tide")])
    assert [len(subject.mesh.vertices) for subject in subjects] == [36, 2930, 256]
    assert [subject.caption for subject in subjects] == ["patch", "spot", "patch, level 0: 256 vertices"]
    levels = load_subjects([str(tmp_path / "patch.tide")], all_levels=True)
    assert [len(subject.mesh.vertices) for subject in levels] == [row.vertices for row in encoded.header.levels]


def test_a_damaged_stream_is_told(tmp_path: Path) -> None:
    (tmp_path / "bad.tide").write_bytes(b"not a stream")
    with pytest.raises(ContainerError):
        load_subjects([str(tmp_path / "bad.tide")])


def test_distances_are_shares_of_the_diagonal() -> None:
    square = Mesh.checked([[0, 0, 0], [3, 0, 0], [3, 4, 0], [0, 4, 0]], [[0, 1, 2], [0, 2, 3]])
    above = Mesh(square.vertices + np.array([0, 0, 0.5]), square.faces)
    coloured, scale = coloured_by_distance([Subject("same", square), Subject("above", above)], square)
    np.testing.assert_allclose(coloured[0].values, 0.0, atol=1e-12)
    np.testing.assert_allclose(coloured[1].values, 0.1)
    assert scale.high == pytest.approx(0.1)


def test_no_distance_can_be_drawn_too() -> None:
    square = grid(4)
    _, scale = coloured_by_distance([Subject("same", square)], square)
    assert scale.high > 0.0


def test_a_point_is_no_reference() -> None:
    with pytest.raises(OptionError, match="single point"):
        coloured_by_distance([Subject("x", grid(3))], shapes()["point"]())
