from __future__ import annotations

import json
import os
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest
from typer.testing import CliRunner

from meshtide_client.commands import application
from meshtide_client.connection.link import Link
from meshtide_client.export.site import export_static
from meshtide_client.remote.listing import list_meshes
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.decoder import decode
from meshtide_codec.errors import OptionError, TransferError
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.stream.container import read_container
from meshtide_codec.testing import grid
from streams import encoded_grid
from web_server import WebServer, web_server

WHOLE = encoded_grid().to_bytes()
DAMAGED = WHOLE[:-1] + bytes([WHOLE[-1] ^ 1])
QUICK = Link(retries=0)


@pytest.fixture(name="scans")
def _scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    folder.mkdir()
    (folder / "Old Vase.tide").write_bytes(WHOLE)
    (folder / ".hidden.tide").write_bytes(b"never looked at")
    (folder / "notes.txt").write_text("nor this")
    save_mesh(grid(6), folder / "patch.ply")
    return folder


def listed(site: Path) -> list[tuple[str, int]]:
    return [(row["id"], row["bytes"]) for row in json.loads((site / "meshes" / "index.json").read_text())]


async def test_a_folder_is_copied_and_encoded(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    meshes, failed = await export_static([str(scans)], site, options=ClassicOptions(bits=8), link=QUICK)
    assert failed == ()
    assert [(mesh.id, mesh.status) for mesh in meshes] == [("old-vase", "ready"), ("patch", "ready")]
    assert (site / "meshes" / "old-vase.tide").read_bytes() == WHOLE
    encoded = (site / "meshes" / "patch.tide").read_bytes()
    assert len(decode(encoded).faces) == len(grid(6).faces)
    assert read_container(encoded)[0].bits == 8
    assert listed(site) == [("old-vase", len(WHOLE)), ("patch", len(encoded))]
    assert {path.name for path in (site / "meshes").iterdir()} == {"index.json", "old-vase.tide", "patch.tide"}


async def test_a_later_export_adds_to_the_list(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    with web_server(WebServer(WHOLE, ranges=False)) as server:
        await export_static([f"{server.url}/cup.tide", f"{server.url}/other/mug.tide"], site, link=QUICK)
    assert [identifier for identifier, _ in listed(site)] == ["cup", "mug", "old-vase"]


async def test_what_leads_to_one_id_is_refused_before_anything_is_written(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    save_mesh(grid(5), scans / "Patch.obj")
    with pytest.raises(OptionError, match=r"Patch\.obj and .*patch\.ply would both become patch"):
        await export_static([str(scans)], site, options=ClassicOptions(bits=8), link=QUICK)
    with pytest.raises(OptionError, match=r"/a/cup\.tide and .*/b/cup\.tide would both become cup"):
        await export_static(["http://127.0.0.1:9/a/cup.tide", "http://127.0.0.1:9/b/cup.tide"], site, link=QUICK)
    assert not site.exists()


async def test_a_mesh_is_made_anew_of_its_own_source_only(scans: Path, tmp_path: Path) -> None:
    site, options = tmp_path / "site", ClassicOptions(bits=8)
    await export_static([str(scans / "patch.ply")], site, options=options, link=QUICK)
    first = (site / "meshes" / "patch.tide").read_bytes()
    save_mesh(grid(5), scans / "patch.ply")  # the mesh was worked on
    await export_static([str(scans / "patch.ply")], site, options=options, link=QUICK)
    second = (site / "meshes" / "patch.tide").read_bytes()
    assert second != first
    other = tmp_path / "other"
    other.mkdir()
    save_mesh(grid(4), other / "patch.ply")
    (other / "alone.tide").write_bytes(WHOLE)
    sources = [str(other / "alone.tide"), str(other / "patch.ply")]
    with pytest.raises(OptionError, match=r"patch\.tide is there already"):
        await export_static(sources, site, options=options, link=QUICK)
    assert listed(site) == [("patch", len(second))]
    assert (site / "meshes" / "patch.tide").read_bytes() == second
    await export_static(sources, site, options=options, link=QUICK, overwrite=True)
    assert [identifier for identifier, _ in listed(site)] == ["alone", "patch"]
    assert (site / "meshes" / "patch.tide").read_bytes() not in {first, second}


async def test_files_of_others_stay(scans: Path, tmp_path: Path) -> None:
    collection = tmp_path / "site" / "meshes"
    collection.mkdir(parents=True)
    (collection / "index.json").write_text("my notes")
    with pytest.raises(OptionError, match=r"index\.json is there already"):
        await export_static([str(scans / "Old Vase.tide")], tmp_path / "site", link=QUICK)
    (collection / "index.json").unlink()
    (collection / "old-vase.tide").write_text("mine as well")
    with pytest.raises(OptionError, match=r"old-vase\.tide is there already"):
        await export_static([str(scans / "Old Vase.tide")], tmp_path / "site", link=QUICK)
    assert [(path.name, path.read_text()) for path in collection.iterdir()] == [("old-vase.tide", "mine as well")]
    source = collection / "old-vase.tide"
    source.write_bytes(WHOLE)
    for overwrite in (False, True):
        with pytest.raises(OptionError, match="is what is read"):
            await export_static([str(source)], tmp_path / "site", link=QUICK, overwrite=overwrite)
    with pytest.raises(OptionError, match="is a file; name a folder"):
        await export_static([str(scans / "Old Vase.tide")], scans / "patch.ply", link=QUICK)


@pytest.mark.parametrize("name", ["caf\udce9", "\udcff", "a\nb\x1b[31m", "\u202eexe", "[bold]x[red]", "網"])
async def test_no_name_breaks_the_list(tmp_path: Path, name: str) -> None:
    (tmp_path / f"{name}.tide").write_bytes(WHOLE)
    (tmp_path / "good.tide").write_bytes(WHOLE)
    told: list[str] = []
    meshes = (await export_static([str(tmp_path)], tmp_path / "site", link=QUICK, notify=told.append)).meshes
    assert len({mesh.id for mesh in meshes}) == 2
    text = (tmp_path / "site" / "meshes" / "index.json").read_text("utf-8")
    assert {row["id"] for row in json.loads(text)} == {mesh.id for mesh in meshes}
    for row in json.loads(text):
        row["name"].encode("utf-8")
        assert row["name"].isprintable()
    with web_server(WebServer(text.encode())) as copy:
        assert list_meshes(copy.url) == meshes


async def test_names_without_letters_are_told_apart(tmp_path: Path) -> None:
    for name in ("網", "猫", "\udcfe", "\udcff"):
        (tmp_path / f"{name}.tide").write_bytes(WHOLE)
    assert len((await export_static([str(tmp_path)], tmp_path / "site", link=QUICK)).meshes) == 4


async def test_what_a_server_tells_of_its_meshes_goes_with_them(scans: Path, tmp_path: Path) -> None:
    row = {
        "id": "cup", "name": "Cup.obj", "status": "ready", "stage": None, "progress": 1.0, "reason": None,
        "vertices": 1, "faces": 1, "levels": 1, "bytes": 1, "tags": ["clay"], "licence": "CC BY 4.0",
        "created": "2026-11-02T09:30:00Z", "updated": "2026-11-02T09:30:00Z", "source": "0a" * 32,
        "box": {"minimum": [0, 0, 0], "maximum": [1, 2, 3]},
    }  # fmt: skip
    index = json.dumps([row]).encode()

    class Catalogue(WebServer):
        def answer(self, request: BaseHTTPRequestHandler) -> None:
            self.content = index if request.path.startswith("/meshes?") else WHOLE
            super().answer(request)

    site = tmp_path / "site"
    with web_server(Catalogue(WHOLE, ranges=False)) as server:
        ((cup,), _) = await export_static([server.url], site, link=QUICK)
    assert (cup.name, cup.tags, cup.licence, cup.source) == ("Cup.obj", ("clay",), "CC BY 4.0", "0a" * 32)
    assert cup.bytes == len(WHOLE)
    again = (await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)).meshes
    assert [mesh.licence for mesh in again] == ["CC BY 4.0", None]  # what was exported earlier stays as it was told
    with web_server(WebServer((site / "meshes" / "index.json").read_bytes())) as copy:
        assert list_meshes(copy.url) == again
    (scans / "cup.tide").write_bytes(WHOLE)
    assert (await export_static([str(scans / "cup.tide")], site, link=QUICK, overwrite=True)).meshes[0].licence is None
    (site / "meshes" / "index.json").write_text("no list")
    assert len((await export_static([str(scans / "cup.tide")], site, link=QUICK, overwrite=True)).meshes) == 2


async def test_nothing_damaged_is_exported(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    (scans / "Old Vase.tide").write_bytes(DAMAGED)
    meshes, failed = await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    assert [mesh.id for mesh in meshes] == ["old-vase"]  # of the earlier export
    ((source, error),) = failed
    assert source == str(scans / "Old Vase.tide")
    assert "is damaged" in error
    assert (site / "meshes" / "old-vase.tide").read_bytes() == WHOLE


async def test_one_that_fails_stops_no_other_and_each_is_told(scans: Path, tmp_path: Path) -> None:
    site, told = tmp_path / "site", list[str]()
    (scans / "a.ply").write_text("no mesh")
    (scans / "b.tide").write_bytes(DAMAGED)
    (scans / "c.obj").write_text("v 0 0 0\n")
    (scans / "dead.ply").symlink_to("gone.ply")
    os.mkfifo(scans / "pipe.tide")
    sources, options = [str(scans), str(scans / "gone.ply")], ClassicOptions(bits=8)
    meshes, failed = await export_static(sources, site, options=options, link=QUICK, notify=told.append)
    assert [mesh.id for mesh in meshes] == ["old-vase", "patch"] == [identifier for identifier, _ in listed(site)]
    assert [Path(source).name for source, _ in failed] == ["a.ply", "b.tide", "c.obj", "gone.ply"]
    assert sum(" failed: " in sentence for sentence in told) == 4
    assert f"{scans / 'dead.ply'} is left out: it is a link that leads nowhere" in told
    assert f"{scans / 'pipe.tide'} is left out: it is a pipe, no file" in told


async def test_one_mesh_of_a_server_that_fails_stops_no_other(tmp_path: Path) -> None:
    row = {
        "status": "ready", "stage": None, "progress": 1.0, "reason": None,
        "vertices": 1, "faces": 1, "levels": 1, "bytes": 1,
    }  # fmt: skip
    index = json.dumps([{"id": name, "name": f"{name}.ply"} | row for name in ("bad", "cup", "pot")]).encode()

    class Catalogue(WebServer):
        def answer(self, request: BaseHTTPRequestHandler) -> None:
            answers = {"/meshes?": index, "/meshes/bad": DAMAGED}
            found = [answer for start, answer in answers.items() if request.path.startswith(start)]
            self.content = found[0] if found else WHOLE
            super().answer(request)

    with web_server(Catalogue(WHOLE, ranges=False)) as server:
        meshes, failed = await export_static([server.url], tmp_path / "site", link=QUICK)
        assert [mesh.id for mesh in meshes] == ["cup", "pot"]
        assert [source for source, _ in failed] == [f"{server.url}/meshes/bad"]


async def test_a_foreign_file_in_the_folder_is_told_and_not_listed(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    (site / "meshes").mkdir(parents=True)
    (site / "meshes" / "notes.tide").write_text("no stream")
    (site / "meshes" / "short.tide").write_bytes(WHOLE[:20])
    meshes, failed = await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    assert [mesh.id for mesh in meshes] == ["old-vase"]
    assert [Path(source).name for source, _ in failed] == ["notes.tide", "short.tide"]


def test_the_command_ends_with_1_if_any_failed(scans: Path, tmp_path: Path) -> None:
    (scans / "a.ply").write_text("no mesh")
    command = ["export", str(scans), "--static", str(tmp_path / "site"), "--profile", "classic"]
    done = CliRunner().invoke(application.build(), [*command, "--json"])
    assert done.exit_code == 1
    answer = json.loads(done.stdout)
    assert [row["id"] for row in answer["meshes"]] == ["old-vase", "patch"]
    assert [Path(row["source"]).name for row in answer["failed"]] == ["a.ply"]
    again = CliRunner().invoke(application.build(), command)
    assert (again.exit_code, "; 1 failed" in again.stdout, "a.ply failed: " in again.stderr) == (1, True, True)


async def test_sources_that_are_none_are_told(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(OptionError, match="nothing to export"):
        await export_static([str(empty)], tmp_path / "site")
    with pytest.raises(OptionError, match="write it like"):
        await export_static(["nowhere"], tmp_path / "site")
    with pytest.raises(TransferError, match="cannot reach"):
        await export_static(["http://127.0.0.1:9"], tmp_path / "site", link=QUICK)


async def test_a_mesh_that_fails_leaves_nothing(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    (scans / "Old Vase.tide").write_bytes(DAMAGED)
    _, (failure,) = await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    assert "Old Vase.tide" in failure.source
    assert "goes on" not in failure.error
    assert not site.exists()
    await export_static([str(scans / "patch.ply")], site, options=ClassicOptions(bits=8), link=QUICK)
    await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    assert {path.name for path in (site / "meshes").iterdir()} == {"index.json", "patch.tide"}


async def test_an_export_that_is_interrupted_leaves_nothing(scans: Path, tmp_path: Path) -> None:
    def interrupted(_sentence: str) -> None:
        raise KeyboardInterrupt

    site = tmp_path / "site"
    (scans / "Old Vase.tide").write_bytes(WHOLE[:-20])
    with web_server(WebServer(WHOLE[:-20], ranges=False)) as server, pytest.raises(KeyboardInterrupt):
        await export_static([f"{server.url}/vase.tide"], site, link=Link(retries=3), notify=interrupted)
    assert not site.exists()
