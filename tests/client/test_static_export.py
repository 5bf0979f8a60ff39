from __future__ import annotations

import json
from pathlib import Path

import pytest

from meshes import grid
from meshtide_client.static_export import export_static
from meshtide_client.transport import Link
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.decoder import decode
from meshtide_codec.errors import OptionError, PacketError, TransferError
from meshtide_codec.files import save_mesh
from meshtide_codec.stream.container import read_container
from streams import encoded_grid
from web_server import WebServer, web_server

WHOLE = encoded_grid().to_bytes()
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
    meshes = await export_static([str(scans)], site, options=ClassicOptions(bits=8), link=QUICK)
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
        await export_static([f"{server.url}/cup.tide", f"{server.url}/other/cup.tide"], site, link=QUICK)
    assert [identifier for identifier, _ in listed(site)] == ["cup", "cup-2", "old-vase"]


async def test_nothing_damaged_is_exported(scans: Path, tmp_path: Path) -> None:
    site = tmp_path / "site"
    await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    (scans / "Old Vase.tide").write_bytes(WHOLE[:-1] + bytes([WHOLE[-1] ^ 1]))
    with pytest.raises(PacketError, match="is damaged"):
        await export_static([str(scans / "Old Vase.tide")], site, link=QUICK)
    assert (site / "meshes" / "old-vase.tide").read_bytes() == WHOLE


async def test_sources_that_are_none_are_told(tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(OptionError, match="nothing to export"):
        await export_static([str(empty)], tmp_path / "site")
    with pytest.raises(OptionError, match="write it like"):
        await export_static(["nowhere"], tmp_path / "site")
    with pytest.raises(TransferError, match="cannot reach"):
        await export_static(["http://127.0.0.1:9"], tmp_path / "site", link=QUICK)
