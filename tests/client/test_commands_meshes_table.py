from __future__ import annotations

from dataclasses import replace

from rich.console import Console

from meshtide_client.commands.meshes_table import listing_table
from meshtide_client.remote.listing import ListedMesh


def shown(mesh: ListedMesh) -> str:
    console = Console(width=120, record=True, quiet=False, file=open("/dev/null", "w"))  # noqa: PTH123, SIM115
    with console.file:
        console.print(listing_table([mesh]))
        return console.export_text()


READY = ListedMesh("vase", "vase.ply", "ready", None, 1.0, None, 100, 200, 4, 500)


def test_a_ready_mesh_shows_its_figures() -> None:
    row = shown(READY).splitlines()[3]
    assert [cell.strip() for cell in row.strip("│").split("│")] == ["vase", "ready", "100", "200", "4", "500", "40.00"]


def test_an_encoding_mesh_shows_how_far_it_is() -> None:
    assert "encoding: levels, 25%" in shown(
        ListedMesh("cup", "cup.ply", "encoding", "levels", 0.25, None, None, None, None, None)
    )


def test_a_failed_mesh_shows_why_and_markup_is_not_obeyed() -> None:
    text = shown(ListedMesh("[red]cup", "cup.ply", "failed", None, 0.0, "face [1] is [bold]", None, None, None, None))
    assert "failed: face [1] is [bold]" in text
    assert "[red]cup" in text


def test_tags_are_a_column_where_there_are_any() -> None:
    text = shown(replace(READY, tags=("clay", "scan")))
    assert "clay, scan" in text
    assert "tags" not in shown(READY)


def test_nothing_in_a_list_steers_the_terminal() -> None:
    text = shown(ListedMesh("a\x1b[31m", "n", "failed", None, 0.0, "\u202e\x07\udcff", 1, 1, 1, 1, tags=("t\n",)))
    assert r"a\x1b[31m" in text
    assert r"failed: \u202e\x07\udcff" in text
    assert r"t\n" in text
