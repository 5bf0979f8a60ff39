from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

from command_runner import meshtide

if TYPE_CHECKING:
    from pathlib import Path


def test_info_tells_bytes_by_level_and_kind(stream_file: Path) -> None:
    answer = json.loads(meshtide("info", stream_file, "--json").stdout)
    assert answer["bytes"] == stream_file.stat().st_size
    assert answer["vertices"] == 256
    assert set(answer["bytes_by_kind"]) == {"Base", "Map&Conn", "Param", "Diff"}
    text = meshtide("info", stream_file).stdout
    assert "predictor polynomial (degree 3, basis power, norm 2.0)" in text
    assert "Map&Conn" in text


def test_info_with_statistics_of_the_diffs(stream_file: Path) -> None:
    answer = json.loads(meshtide("info", stream_file, "--statistics", "--json").stdout)
    levels = [row["level"] for row in answer["differences"]]
    assert levels == [row["level"] for row in answer["levels"]][1:]
    assert all(row["shannon_bits"] > 0 for row in answer["differences"])
    assert "Shannon's bound" in meshtide("info", stream_file, "--statistics").stdout


def test_info_loads_no_coder(stream_file: Path) -> None:
    script = (
        "import sys, typer\nfrom meshtide_codec.commands.info import info\nfrom pathlib import Path\n"
        f"info(Path({str(stream_file)!r}), as_json=True)\nassert 'numba' not in sys.modules, 'numba was loaded'"
    )
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
