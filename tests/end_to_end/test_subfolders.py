"""Meshes in subfolders: their ids hold slashes, and everything works with them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import httpx

from hosted_folder import serving
from meshtide_codec.command_line import ExitCode

GOLDEN = Path(__file__).parents[1] / "golden"
FILES = {
    "vase": "compact-scattered-1",
    "scans/bunny": "compact-scattered-2",
    "scans/My Old/bunny": "compact-scattered-3",
}
IDS = {"vase": "vase", "scans/bunny": "scans/bunny", "scans/My Old/bunny": "scans/my-old/bunny"}


def test_meshes_of_subfolders_are_listed_found_streamed_and_exported(meshtide: Any, tmp_path: Path) -> None:
    streams = {}
    for place, name in FILES.items():
        path = tmp_path / "meshes" / f"{place}.tide"
        path.parent.mkdir(parents=True, exist_ok=True)
        streams[IDS[place]] = (GOLDEN / f"{name}.tide").read_bytes()
        path.write_bytes(streams[IDS[place]])
    with serving(tmp_path / "meshes", "--recursive") as url:
        rows = json.loads(meshtide("meshes", url, "--json").stdout)["meshes"]
        assert {row["id"]: row["status"] for row in rows} == dict.fromkeys(streams, "ready")
        page = httpx.get(f"{url}/meshes?limit=2")
        after = httpx.get(url + page.headers["link"].split(">")[0].removeprefix("<"))
        assert [row["id"] for row in (*page.json(), *after.json())] == sorted(streams)
        assert [row["id"] for row in httpx.get(f"{url}/meshes?q=old").json()] == ["scans/my-old/bunny"]
        for mesh, whole in streams.items():
            for written in (mesh, mesh.replace("/", "%2F"), mesh.replace("/", "%2f")):
                assert httpx.get(f"{url}/meshes/{written}.tide").content == whole
                detail = httpx.get(f"{url}/meshes/{written}").json()
                assert detail["id"] == mesh
                assert whole[8:].find(httpx.get(f"{url}/meshes/{written}/header").content) >= 0
            packet = detail["packets"][-1]
            assert whole.endswith(httpx.get(f"{url}/packets/{packet['sha256']}").content)
            for transport in ("websocket", "http", "download") if mesh == "scans/my-old/bunny" else ():
                done = meshtide("fetch", f"{url}/meshes/{mesh}", "--transport", transport, "-o", f"{transport}.ply",
                                "--stream-file", f"{transport}.tide", "--json")  # fmt: skip
                assert done.returncode == ExitCode.OK, done.stderr
                assert (meshtide.folder / f"{transport}.tide").read_bytes() == whole
                for kind in ("ply", "tide"):
                    (meshtide.folder / f"{transport}.{kind}").unlink()
        exported = meshtide("export", url, "--static", "site", "--json")
        assert exported.returncode == ExitCode.OK, exported.stderr
        assert httpx.get(f"{url}/meshes/scans/../vase").status_code in {200, 404}
    site = meshtide.folder / "site" / "meshes"
    assert {mesh: (site / f"{mesh}.tide").read_bytes() for mesh in streams} == streams
    assert [row["id"] for row in json.loads((site / "index.json").read_bytes())] == sorted(streams)
    again = meshtide("export", str(tmp_path / "meshes" / "vase.tide"), "--static", "site", "--overwrite", "--json")
    assert again.returncode == ExitCode.OK, again.stderr
    assert [row["id"] for row in json.loads((site / "index.json").read_bytes())] == sorted(streams)
    with serving(tmp_path / "meshes") as url:
        assert [row["id"] for row in httpx.get(f"{url}/meshes").json()] == ["vase"]
        assert httpx.get(f"{url}/meshes/scans/bunny").status_code == 404
