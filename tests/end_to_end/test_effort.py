"""Effort high, from what a person asks for to what arrives: servers, commands, and streams that are cut or lossy."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import meshtide_client
from bulk_ingests import kept_in
from meshtide_client.commands.server_process import running_server
from meshtide_client.connection.link import Link
from meshtide_codec.command_line import ExitCode
from meshtide_codec.compact.options import CompactHeader, CompactOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import TransferError
from meshtide_codec.mesh import Mesh
from meshtide_codec.mesh_files import load_mesh, save_mesh
from meshtide_codec.packets import PacketKind
from meshtide_codec.testing import grid, random_meshes, shapes
from meshtide_lab.link.lossy_link import LossyLink
from streams import slice_of
from upload_server import TOKEN, taking_uploads

BITS = 8
SLICES = 4
SCANS = ("grid", "two components", "soup", "book")
SLICED = "sliced"
HANDSHAKE = 1000
"""Bytes: more than a server sends until a websocket is open, or the first answer has begun."""
QUICK = Link(retries=8, delay=0.01, longest_delay=0.05)


def high(mesh: Mesh, slices: int = 1) -> EncodedMesh:
    return encode(mesh, CompactOptions(bits=BITS, slices=slices, effort="high"))


@cache
def sliced_patch() -> EncodedMesh:
    return encode(grid(40), CompactOptions(bits=10, slices=SLICES, effort="high"))


def assert_exact(mesh: Mesh, encoded: EncodedMesh) -> None:
    expected = encoded.quantized.mesh()
    np.testing.assert_array_equal(mesh.vertices, expected.vertices)
    np.testing.assert_array_equal(mesh.faces, expected.faces)


@dataclass
class Hosting:
    """A server process of effort high, and the folder that it hosts."""

    url: str
    folder: Path
    added: list[str] = field(default_factory=list)

    def add(self, data: bytes) -> str:
        """Put a stream into the folder; its address, once the server shows it."""
        name = f"added-{len(self.added)}"
        self.added.append(name)
        (self.folder / f".{name}.part").write_bytes(data)
        (self.folder / f".{name}.part").rename(self.folder / f"{name}.tide")
        self.wait_for(name)
        return f"/meshes/{name}"

    def wait_for(self, *names: str) -> None:
        deadline = time.monotonic() + 120
        while any(httpx.get(f"{self.url}/meshes/{name}").status_code != httpx.codes.OK for name in names):
            assert time.monotonic() < deadline
            time.sleep(0.02)


@pytest.fixture(scope="module", name="scans")
def _scans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scans")
    for name in SCANS:
        save_mesh(shapes()[name](), folder / f"{name.replace(' ', '-')}.ply")
    return folder


@pytest.fixture(scope="module", name="expected")
def _expected(scans: Path) -> dict[str, EncodedMesh]:
    return {path.stem: high(load_mesh(path)) for path in scans.glob("*.ply")}


@pytest.fixture(scope="module", name="hosting")
def _hosting(
    scans: Path, expected: dict[str, EncodedMesh], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Hosting]:
    (scans / f"{SLICED}.tide").write_bytes(sliced_patch().to_bytes())
    how = ["--effort", "high", "--bits", str(BITS), "--rescan-seconds", "0.05"]
    with running_server([str(scans), *how, "--cache", str(tmp_path_factory.mktemp("cache"))]) as url:
        hosting = Hosting(url, scans)
        hosting.wait_for(*expected, SLICED)
        yield hosting


def test_a_folder_is_encoded_and_streamed_at_the_effort_of_the_server(
    hosting: Hosting, expected: dict[str, EncodedMesh]
) -> None:
    for name, encoded in expected.items():
        assert httpx.get(f"{hosting.url}/meshes/{name}.tide").content == encoded.to_bytes()
        assert httpx.get(f"{hosting.url}/meshes/{name}").json()["effort"] == "high"
        assert_exact(meshtide_client.fetch(f"{hosting.url}/meshes/{name}").mesh, encoded)


@given(random_meshes(200), st.integers(1, 3), st.floats(0.0, 1.0), st.sampled_from(["websocket", "http"]))
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_mesh_arrives_exactly_though_its_stream_is_cut_and_resumed(
    hosting: Hosting,
    relay: Callable[[str, int], Any],
    tmp_path: Path,
    mesh: Mesh,
    slices: int,
    cut: float,
    transport: str,
) -> None:
    encoded = high(mesh, slices)
    whole = encoded.to_bytes()
    address = hosting.add(whole)
    file = tmp_path / f"{hosting.added[-1]}.tide"
    broken = relay(hosting.url, 1 + int(cut * len(whole)))
    broken.cut.set()
    with suppress(TransferError):
        meshtide_client.fetch(broken.url + address, stream_file=file, link=Link(retries=0), transport=transport)
    held = file.stat().st_size if file.exists() else 0
    rest = meshtide_client.fetch(hosting.url + address, stream_file=file, transport=transport)
    assert_exact(rest.mesh, encoded)
    assert file.read_bytes() == whole
    if transport == "websocket":
        assert rest.received_bytes <= len(whole) - held
    breaking = relay(hosting.url, HANDSHAKE + int(cut * len(whole)))
    breaking.cut.set()
    assert_exact(meshtide_client.fetch(breaking.url + address, link=QUICK, transport=transport).mesh, encoded)


@given(st.data())
@settings(max_examples=10, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_lost_diff_leaves_the_faces_and_all_other_slices_exact(hosting: Hosting, data: st.DataObject) -> None:
    encoded = sliced_patch()
    diffs = [index for index, packet in enumerate(encoded.packets) if packet.kind is PacketKind.DIFF]
    lost = data.draw(st.sampled_from(diffs))
    options = encoded.header.options
    assert isinstance(options, CompactHeader)
    assert len(options.slices) == SLICES
    of_lost = slice_of(encoded, encoded.packets[lost].slice)
    live = meshtide_client.fetch(f"{hosting.url}/meshes/{SLICED}", loss=LossyLink.parse(f"drop:packet={lost}", 1))
    exact = encoded.quantized.mesh()
    np.testing.assert_array_equal(live.mesh.faces, exact.faces)
    assert not live.figures.exact
    changed = np.flatnonzero((live.mesh.vertices != exact.vertices).any(axis=1))
    assert len(changed)
    assert of_lost[changed].all()


def test_ingest_takes_an_effort_with_and_without_a_server(
    scans: Path,
    expected: dict[str, EncodedMesh],
    meshtide: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    files = [scans / "grid.ply", scans / "soup.ply"]
    how = ("--bits", str(BITS), "--effort", "high")
    streams = {file.stem: expected[file.stem].to_bytes() for file in files}
    ran = meshtide("ingest", *files, "--data", tmp_path / "kept", "--workers", "1", *how)
    assert (ran.returncode, ran.stdout) == (0, "2 ingested, 0 there before, 0 failed\n"), ran.stderr
    assert kept_in(tmp_path / "kept").streams == streams
    monkeypatch.setenv("MESHTIDE_TOKEN", TOKEN)
    with taking_uploads(MESHTIDE_DATA=str(tmp_path / "data")) as (url, _):
        ran = meshtide("ingest", *files, "--server", url, *how)
        assert (ran.returncode, ran.stdout) == (0, "2 ingested, 0 there before, 0 failed\n"), ran.stderr
    assert kept_in(tmp_path / "data").streams == streams
    ran = meshtide("ingest", *files, "--data", tmp_path / "kept", "--profile", "classic", "--effort", "high")
    assert ran.returncode == ExitCode.USAGE
    assert "effort high is of profile compact" in ran.stderr


def test_export_takes_an_effort(scans: Path, expected: dict[str, EncodedMesh], meshtide: Any) -> None:
    command = ("export", scans / "grid.ply", "--static", "site", "--bits", str(BITS), "--json")
    done = meshtide(*command, "--effort", "high")
    assert done.returncode == ExitCode.OK, done.stderr
    assert [mesh["id"] for mesh in json.loads(done.stdout)["meshes"]] == ["grid"]
    assert (meshtide.folder / "site" / "meshes" / "grid.tide").read_bytes() == expected["grid"].to_bytes()
    refused = meshtide(*command, "--effort", "high", "--profile", "classic")
    assert refused.returncode == ExitCode.USAGE
    assert "--effort belongs to profile compact" in refused.stderr
