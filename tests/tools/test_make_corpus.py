from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from golden_streams import GOLDEN
from meshtide_codec.stream.container import read_container

SCRIPT = Path(__file__).parents[2] / "tools" / "make_corpus.py"
TOOL = runpy.run_path(str(SCRIPT))
seeds, LARGEST_HEADER, PREAMBLE = TOOL["seeds"], TOOL["LARGEST_HEADER"], TOOL["PREAMBLE"]


def test_seeds_are_the_parts_of_a_stream() -> None:
    data = (GOLDEN / "compact-bowl.tide").read_bytes()
    header, packets = read_container(data)
    made = seeds(data)
    assert made["header"] == header.to_bytes()
    assert made["entropy"] == b"".join(packet.payload for packet in packets)
    length = int.from_bytes(made["decoder"][:2], "little")
    assert made["decoder"][2:] == made["header"] + made["entropy"]
    assert length == len(made["header"])


def test_every_golden_stream_is_a_seed_of_every_target(tmp_path: Path) -> None:
    subprocess.run([sys.executable, SCRIPT, tmp_path], check=True)
    targets = {path.stem for path in (SCRIPT.parents[1] / "codec" / "core" / "fuzz").glob("*.cpp")}
    assert {path.name for path in tmp_path.iterdir()} == targets
    made = {path.read_bytes() for path in (tmp_path / "decoder").iterdir()}
    assert made == {seeds(path.read_bytes())["decoder"] for path in GOLDEN.glob("*.tide")}


def test_a_header_that_is_too_long_is_refused() -> None:
    length = LARGEST_HEADER + 1
    with pytest.raises(ValueError, match=f"a header of {length} bytes"):
        seeds(PREAMBLE.pack(b"", 4, length, 0) + bytes(length))


def test_without_a_folder_it_tells_how_to_use_it() -> None:
    done = subprocess.run([sys.executable, SCRIPT], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert "python tools/make_corpus.py build/corpus" in done.stderr
