"""Files that are packed as they are written."""

from __future__ import annotations

import gzip
from typing import TYPE_CHECKING

import numpy as np
import pytest

from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files.read import load_mesh
from meshtide_codec.mesh_files.write import save_mesh

if TYPE_CHECKING:
    from pathlib import Path

TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3]])
)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".off", ".stl", ".glb"])
def test_a_file_named_gz_is_packed(suffix: str, tmp_path: Path) -> None:
    plain, packed, again = tmp_path / f"a{suffix}", tmp_path / f"a{suffix}.gz", tmp_path / f"b{suffix}.GZ"
    for path in (plain, packed, again):
        save_mesh(TETRAHEDRON, path)
    assert gzip.decompress(packed.read_bytes()) == plain.read_bytes()
    assert packed.read_bytes() == again.read_bytes()
    assert packed.read_bytes()[4:8] == bytes(4)  # no time
    assert len(load_mesh(packed).faces) == 3


def test_a_kind_and_a_name_that_ends_in_gz(tmp_path: Path) -> None:
    path = tmp_path / "a.gz"
    save_mesh(TETRAHEDRON, path, kind="off")
    assert gzip.decompress(path.read_bytes()).startswith(b"OFF")
