"""`meshtide fetch --loss` from a real server: the same mesh as the stored stream gives over the same link."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import meshtide_client
from hosted_folder import serving
from meshtide_codec.classic.options import ClassicOptions
from meshtide_codec.command_line import ExitCode
from meshtide_codec.compact.options import CompactOptions
from meshtide_codec.encoder import EncodedMesh, encode
from meshtide_codec.errors import TransferError
from meshtide_codec.mesh_files import load_mesh
from meshtide_codec.stream.container import read_container
from meshtide_codec.testing import grid
from meshtide_lab.link.lossy_link import LossyLink, receive

STREAMS = {
    "classic": ClassicOptions(bits=12, coarsest_vertices=20),
    "compact": CompactOptions(bits=12),
    "sliced": CompactOptions(bits=12, slices=12),
}
LINKS = [
    "gilbert:p=0.2,r=0.3",
    "noise:kind=laplace,relative=1 + loss:rate=0.1",
    "bandwidth:rate=8000 + jitter:seconds=0.5 + deadline:seconds=0.6",
    "biterrors:rate=2e-4,checks=off",
]


@pytest.fixture(scope="module", name="encoded_streams")
def _encoded_streams() -> dict[str, EncodedMesh]:
    return {name: encode(grid(40), options) for name, options in STREAMS.items()}


@pytest.fixture(scope="module", name="url")
def _url(encoded_streams: dict[str, EncodedMesh], tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("lossy")
    for name, encoded in encoded_streams.items():
        (folder / f"{name}.tide").write_bytes(encoded.to_bytes())
    with serving(folder) as address:
        yield address


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize("text", LINKS)
def test_live_and_stored_streams_end_in_the_same_mesh(
    url: str, encoded_streams: dict[str, EncodedMesh], name: str, text: str
) -> None:
    encoded = encoded_streams[name]
    lost = []
    for seed in (1, 2):
        link = LossyLink.parse(text, seed)
        stored = receive(link, encoded.header, encoded.packets)
        live = meshtide_client.fetch(f"{url}/meshes/{name}", loss=link)
        np.testing.assert_array_equal(live.mesh.vertices, stored.decoder.mesh(0).vertices)
        np.testing.assert_array_equal(live.mesh.faces, stored.decoder.mesh(0).faces)
        assert live.link_report == stored.report
        assert live.figures.exact == stored.decoder.is_exact(0)
        lost.append(live.mesh.vertices)
    if "rate=0.1" in text:
        assert (lost[0] != lost[1]).any()


def test_the_command_tells_what_was_lost(url: str, meshtide: Any) -> None:
    arguments = ["fetch", f"{url}/meshes/sliced", "--loss", "loss:rate=0.4", "--seed", "3", "--stream-file", "all.tide"]
    done = meshtide(*arguments, "-o", "first.ply")
    assert done.returncode == ExitCode.OK, done.stderr
    assert "not exact" in done.stdout
    assert "link: " in done.stdout
    assert "by loss" in done.stdout
    again = meshtide(*arguments, "-o", "second.ply", "--json")
    answer = json.loads(again.stdout)
    assert answer["exact"] is False
    assert answer["rms"] is None
    assert answer["link"]["causes"]["loss"] == sum(answer["link"]["lost_kinds"].values()) > 0
    first, second = (meshtide.folder / name for name in ("first.ply", "second.ply"))
    assert first.read_bytes() == second.read_bytes()
    header, packets = read_container((meshtide.folder / "all.tide").read_bytes())
    stored = receive(LossyLink.parse("loss:rate=0.4", 3), header, packets)
    np.testing.assert_allclose(load_mesh(first).vertices, stored.decoder.mesh(0).vertices, rtol=1e-12, atol=1e-12)


def test_unprotected_losses_end_in_a_coarser_level(url: str) -> None:
    link = LossyLink.parse("drop:kind=map-conn,level=0", unprotected="map-conn")
    result = meshtide_client.fetch(f"{url}/meshes/classic", loss=link)
    assert result.figures.level == 1
    assert result.figures.exact
    nothing = LossyLink.parse("loss:rate=1", unprotected="all")
    with pytest.raises(TransferError, match="no level that can be shown"):
        meshtide_client.fetch(f"{url}/meshes/classic", loss=nothing)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--loss", "los:rate=1"], "no link model 'los'"),
        (["--loss", "loss:rate=2"], "probability in [0, 1]"),
        (["--loss", "drop:kind=param"], "--unprotected"),
        (["--unprotected", "all"], "give one with --loss"),
    ],
)
def test_bad_links_are_refused(url: str, meshtide: Any, options: list[str], message: str) -> None:
    done = meshtide("fetch", f"{url}/meshes/classic", *options)
    assert done.returncode == ExitCode.USAGE
    assert message in done.stderr
    assert not Path(meshtide.folder / "classic.ply").exists()


def test_a_hosted_mesh_is_simulated_as_its_file_is(
    url: str, encoded_streams: dict[str, EncodedMesh], meshtide: Any
) -> None:
    (meshtide.folder / "sliced.tide").write_bytes(encoded_streams["sliced"].to_bytes())
    answers = []
    for place, folder in ((f"{url}/meshes/sliced", "hosted"), ("sliced.tide", "stored")):
        arguments = ["--loss", "loss:rate=0.3", "--seeds", "3", "--processes", "1", "--no-plots", "-o", folder]
        done = meshtide("simulate", place, *arguments, "--json")
        assert done.returncode == ExitCode.OK, done.stderr
        answers.append(json.loads(done.stdout))
    hosted, stored = ((meshtide.folder / name / "runs.csv").read_bytes() for name in ("hosted", "stored"))
    assert hosted == stored
    assert answers[0]["summary"] == answers[1]["summary"]
    live = meshtide_client.fetch(f"{url}/meshes/sliced", loss=LossyLink.parse("loss:rate=0.3", 0))
    assert live.link_report is not None
    assert f",{live.link_report.lost}," in hosted.decode().splitlines()[1]
