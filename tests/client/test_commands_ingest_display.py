from __future__ import annotations

import json
from pathlib import Path

import pytest

from meshtide_client.commands.ingest_display import IngestDisplay, print_ingested
from meshtide_client.remote.ingest_plan import Ingested

RESULTS = [
    Ingested(Path("a.ply"), "a", "done", None, ("normals (3): not kept",)),
    Ingested(Path("b.ply"), "a", "kept"),
    Ingested(Path("[bold].ply"), None, "failed", "no [mesh]"),
]


def test_the_end_is_a_line_or_a_json_object(capsys: pytest.CaptureFixture[str]) -> None:
    assert print_ingested(RESULTS, {"store": "kept"}, as_json=False) == 1
    assert capsys.readouterr().out == "1 ingested, 1 there before, 1 failed\n"
    left = [*RESULTS, Ingested(Path("c.ply"), None, "left", "not begun: the disk is full")]
    assert print_ingested(left, {}, as_json=False) == 2
    assert capsys.readouterr().out == "1 ingested, 1 there before, 1 failed, 1 not begun\n"
    skipped = Ingested(Path("d.ply"), None, "skipped", "it is a pipe, no file")
    assert print_ingested([*RESULTS[:2], skipped], {}, as_json=False) == 0
    assert capsys.readouterr().out == "1 ingested, 1 there before, 0 failed, 1 skipped\n"
    with IngestDisplay(2, quiet=False) as display:
        display.skip(skipped)
    assert capsys.readouterr().err == "d.ply: it is a pipe, no file\n"
    assert print_ingested(RESULTS[:2], {"store": "kept"}, as_json=True) == 0
    assert json.loads(capsys.readouterr().out) == {
        "store": "kept",
        "done": 1,
        "kept": 1,
        "failed": 0,
        "left": 0,
        "skipped": 0,
        "files": [
            {"file": "a.ply", "mesh": "a", "state": "done", "error": None, "notes": ["normals (3): not kept"]},
            {"file": "b.ply", "mesh": "a", "state": "kept", "error": None, "notes": []},
        ],
    }


def test_names_and_errors_steer_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    result = Ingested(Path("\x1b[31m\udcff\u202e.ply"), None, "failed", "face \x9b31m")
    with IngestDisplay(1, quiet=False) as display:
        display.report(result)
    assert capsys.readouterr().err.strip() == r"\x1b[31m\udcff\u202e.ply: face \x9b31m"
    print_ingested([result], {}, as_json=True)
    assert json.loads(capsys.readouterr().out)["files"][0]["file"] == "\x1b[31m\\udcff\u202e.ply"


@pytest.mark.parametrize("quiet", [False, True])
def test_failures_and_notes_are_told_as_they_come_unless_they_come_as_json(
    quiet: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    with IngestDisplay(len(RESULTS), quiet=quiet) as display:
        for result in RESULTS:
            display.stage("levels")
            display.report(result)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.strip() == ("" if quiet else "a.ply: normals (3): not kept\n[bold].ply: no [mesh]")


def test_a_person_sees_a_bar_with_what_is_being_done(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    with IngestDisplay(3, quiet=True) as display:
        display.stage("choose previews")
        display.report(RESULTS[0])
    shown = capsys.readouterr().err
    assert "ingest: choose previews" in shown
    assert "1/3" in shown
