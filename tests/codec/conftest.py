"""Files that tests of several commands read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from command_runner import meshtide
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def mesh_file(tmp_path: Path) -> Path:
    path = tmp_path / "grid.ply"
    save_mesh(grid(16), path)
    return path


@pytest.fixture
def stream_file(mesh_file: Path) -> Path:
    result = meshtide("encode", mesh_file, "--profile", "classic", "--bits", 8, "--coarsest-vertices", 12)
    assert result.exit_code == 0, result.output
    return mesh_file.with_suffix(".tide")
