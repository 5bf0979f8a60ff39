"""Uploads to a real server process: all that it acknowledged is encoded, even when it is killed meanwhile."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import numpy as np
import pytest

from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.decoder import decode
from meshtide_codec.encoder import encode
from meshtide_codec.mesh_files import save_mesh
from meshtide_codec.testing import grid
from upload_server import TOKEN, taking_uploads

if TYPE_CHECKING:
    from collections.abc import Callable

BITS = 8


@pytest.fixture(name="scans")
def _scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    folder.mkdir()
    for size in range(5, 13):
        save_mesh(grid(size), folder / f"patch-{size}.ply")
    return folder


def states(url: str) -> dict[str, str]:
    return {row["id"]: row["status"] for row in httpx.get(f"{url}/meshes").json()}


def wait_until(fulfilled: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not fulfilled():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def assert_exact(url: str, size: int) -> None:
    decoded = decode(httpx.get(f"{url}/meshes/patch-{size}.tide").content)
    expected = encode(grid(size), CompactOptions(bits=BITS)).quantized.mesh()
    assert np.array_equal(decoded.vertices, expected.vertices)
    assert np.array_equal(decoded.faces, expected.faces)


def test_a_folder_is_uploaded_and_repeating_it_uploads_nothing(
    tmp_path: Path, scans: Path, meshtide: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MESHTIDE_TOKEN", TOKEN)
    (scans / "broken.obj").write_text("this is not a mesh")
    with taking_uploads(MESHTIDE_DATA=str(tmp_path / "data")) as (url, _):
        ran = meshtide("ingest", scans, "--server", url, "--bits", BITS, "--json")
        answer = json.loads(ran.stdout)
        assert ran.returncode == 1
        assert (answer["done"], answer["kept"], answer["failed"]) == (8, 0, 1)
        failed = next(row for row in answer["files"] if row["state"] == "failed")
        assert failed["file"].endswith("broken.obj")
        assert "mesh" in failed["error"]
        for size in (5, 12):
            assert_exact(url, size)
        (scans / "broken.obj").unlink()
        ran = meshtide("ingest", scans, "--server", url)
        assert (ran.returncode, ran.stdout.strip()) == (0, "0 ingested, 8 there before, 0 failed")
        (scans / "deep").mkdir()
        save_mesh(grid(13), scans / "deep" / "patch-5.ply")
        shutil.copy(scans / "patch-5.ply", scans / "deep" / "renamed.ply")
        ran = meshtide("ingest", scans, "--server", url, "--json")
        answer = json.loads(ran.stdout)
        assert (answer["done"], answer["kept"], answer["failed"]) == (1, 9, 0)
        meshes = {str(Path(row["file"]).relative_to(scans)): row["mesh"] for row in answer["files"]}
        assert (meshes["deep/patch-5.ply"], meshes["deep/renamed.ply"]) == ("patch-5-ply", "patch-5")
        save_mesh(grid(4), scans / "patch-6.ply")
        ran = meshtide("ingest", scans / "patch-6.ply", "--replace", "--bits", BITS, "--server", url)
        assert (ran.returncode, ran.stdout.strip()) == (0, "1 ingested, 0 there before, 0 failed")
        wait_until(lambda: httpx.get(f"{url}/meshes/patch-6").json()["levels"][-1]["vertices"] == 16)
        assert len(states(url)) == 10
        monkeypatch.setenv("MESHTIDE_TOKEN", "another-token-altogether")
        ran = meshtide("ingest", scans / "patch-5.ply", "--replace", "--server", url)
        assert ran.returncode == 5
        assert "set MESHTIDE_TOKEN or --token-file" in ran.stderr


def test_what_was_acknowledged_before_a_kill_is_encoded_after_it(tmp_path: Path, scans: Path) -> None:
    headers = {"Authorization": f"Bearer {TOKEN}"}
    with taking_uploads(MESHTIDE_DATA=str(tmp_path / "data")) as (url, process):
        for size in range(5, 13):
            data = (scans / f"patch-{size}.ply").read_bytes()
            params: dict[str, Any] = {"filename": f"patch-{size}.ply", "bits": BITS}
            assert httpx.post(f"{url}/meshes", params=params, content=data, headers=headers).status_code == 202
        process.kill()
        process.wait()
    with taking_uploads(MESHTIDE_DATA=str(tmp_path / "data")) as (url, _):
        deadline = time.monotonic() + 90
        while set(states(url).values()) != {"ready"} and time.monotonic() < deadline:
            time.sleep(0.2)
        assert states(url) == {f"patch-{size}": "ready" for size in range(5, 13)}
        for size in range(5, 13):
            assert_exact(url, size)
