from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from meshtide_client.commands.fetch_display import Display, result_json, result_line
from meshtide_client.connection.address import MeshAddress
from meshtide_client.download.fetch import FetchResult
from meshtide_client.download.levels import LevelFigures, ReceivedLevel
from meshtide_codec.mesh import Mesh
from streams import MadeUpStream

HEADER = MadeUpStream().header
MESH = Mesh(np.zeros((1, 3)), np.zeros((0, 3), np.int64))
FIGURES = LevelFigures(level=0, vertices=1000, faces=2000, exact=True, rms=0.0, maximum=0.0, size=7000, seconds=0.5)


def result(**changes: Any) -> FetchResult:
    settings: dict[str, Any] = {
        "address": MeshAddress.parse("http://h/meshes/vase"),
        "header": HEADER,
        "mesh": MESH,
        "figures": FIGURES,
        "levels": (FIGURES,),
        "received_bytes": 7000,
        "more": False,
        "seconds": 0.75,
        "transport": "websocket",
    }
    return FetchResult(**(settings | changes))


def test_sentences_of_peers_are_escaped() -> None:
    file = io.StringIO()
    Display("vase", Console(file=file, force_terminal=True)).notify("lost: \x1b]0;x\x07 [red]\u202e")
    assert file.getvalue() == "lost: \\x1b]0;x\\x07 [red]\\u202e\n"


def test_the_line_of_a_whole_mesh() -> None:
    line = result_line(result(), Path("vase.ply"))
    assert line == "vase.ply: level 0, 1000 vertices, 2000 faces; 7000 bytes in 0.75 s"


def test_the_line_of_a_coarse_resumed_mesh() -> None:
    figures = LevelFigures(
        level=1, vertices=500, faces=1000, exact=False, rms=0.125, maximum=0.25, size=300, seconds=0.5
    )
    line = result_line(result(figures=figures, received_bytes=10), Path("vase.ply"))
    assert "level 1, predicted only, rms error 1.25e-01" in line
    assert "300 bytes (10 of them fetched now)" in line


def test_a_coarse_mesh_is_never_shown_as_the_whole_one() -> None:
    """Whatever the server says of its distance."""
    figures = replace(FIGURES, level=1, vertices=37)
    assert "level 1, rms error 0.00e+00, 37 vertices" in result_line(result(figures=figures), Path("vase.ply"))


def test_the_answer_for_programs_is_json() -> None:
    answer = json.loads(json.dumps(result_json(result(), output=Path("vase.ply"), stream_file=Path("vase.tide"))))
    assert answer["mesh"] == "vase"
    assert answer["url"] == "http://h/meshes/vase"
    assert answer["output"] == "vase.ply"
    assert answer["stream_file"] == "vase.tide"
    assert (answer["level"], answer["vertices"], answer["faces"], answer["size"]) == (0, 1000, 2000, 7000)
    assert answer["complete"] is True
    assert answer["transport"] == "websocket"
    assert answer["seconds"] == 0.75
    assert answer["levels"][0]["seconds"] == 0.5


@pytest.mark.parametrize("terminal", [True, False])
def test_the_bar_is_drawn_only_on_a_terminal(terminal: bool) -> None:
    written = io.StringIO()
    display = Display("vase", Console(file=written, force_terminal=terminal, width=120))
    with display.shown():
        display.progress(10, 100)
        display.on_level(ReceivedLevel(**{**{n: getattr(FIGURES, n) for n in FIGURES.__slots__}, "mesh": MESH}))
        display.notify("the connection [was] lost")
    assert ("vase: level 0, 1000 vertices" in written.getvalue()) is terminal
    assert "the connection [was] lost" in written.getvalue()
