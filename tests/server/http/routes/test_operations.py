from collections.abc import Callable
from pathlib import Path

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families
from websockets.sync.client import connect

from meshtide_codec.stream.session import ClientSession
from meshtide_server.settings import Settings

from ...conftest import LiveServer
from ...made_streams import make_stream

HIDDEN_ID = "the-id-of-a-mesh"
LABELS = {"kind", "outcome", "method", "route", "status", "part", "le", "implementation", "major", "minor",
          "patchlevel", "version"}  # fmt: skip


def samples(url: str) -> dict[tuple[str, tuple[tuple[str, str], ...]], float]:
    text = httpx.get(f"{url}/metrics").raise_for_status().text
    return {
        (sample.name, tuple(sorted(sample.labels.items()))): sample.value
        for family in text_string_to_metric_families(text)
        for sample in family.samples
    }


def stream_once(live: LiveServer, mesh: str) -> int:
    session = ClientSession(mesh)
    with connect(f"{live.socket_url}/meshes/{mesh}/stream", compression=None) as connection:
        connection.send(session.hello())
        for frame in connection:
            session.receive(frame)
    assert session.finished
    return session.received_bytes


def test_no_label_holds_the_id_of_a_mesh(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    (folder / f"{HIDDEN_ID}.tide").write_bytes(make_stream())
    live = serve(Settings(directory=folder))
    before = samples(live.url)
    received = stream_once(live, HIDDEN_ID)
    for path in ("", ".tide", "/nothing", "-else", "-else.tide"):
        httpx.get(f"{live.url}/meshes/{HIDDEN_ID}{path}")
    httpx.request("PROPFIND", f"{live.url}/{HIDDEN_ID}")
    with connect(f"{live.socket_url}/meshes/{HIDDEN_ID}-else/stream") as connection:
        connection.recv(5)
    live.running_streams(0)
    after = samples(live.url)
    assert {name for _, labels in after for name, _ in labels} <= LABELS
    assert not [labels for _, labels in after if HIDDEN_ID in str(labels)]

    def grown(name: str, **labels: str) -> float:
        key = (name, tuple(sorted(labels.items())))
        return after.get(key, 0.0) - before.get(key, 0.0)

    assert grown("meshtide_streams_started_total") == 2
    assert grown("meshtide_streams_ended_total", outcome="complete") == 1
    assert grown("meshtide_streams_ended_total", outcome="refused") == 1
    assert grown("meshtide_stream_bytes_total", kind="Base") == 400
    assert sum(after[key] - before[key] for key in after if key[0] == "meshtide_stream_bytes_total") == received
    assert grown("meshtide_first_packet_seconds_count") == 1
    assert grown("meshtide_http_requests_total", method="GET", route="/meshes/{mesh_id}.tide", status="200") == 1
    assert grown("meshtide_http_requests_total", method="other", route="(none)", status="404") == 1
    assert grown("meshtide_http_body_bytes_total", route="/meshes/{mesh_id}.tide") > len(make_stream())


@pytest.mark.parametrize(
    ("settings", "token", "status"),
    [
        ({}, None, 200),
        ({"metrics": "off"}, None, 404),
        ({"read_tokens": "r3ad-r3ad-r3ad-r3ad"}, None, 401),
        ({"read_tokens": "r3ad-r3ad-r3ad-r3ad"}, "r3ad-r3ad-r3ad-r3ad", 200),
        ({"read_tokens": "r3ad-r3ad-r3ad-r3ad", "metrics": "open"}, None, 200),
    ],
)
def test_who_may_read_the_metrics(
    serve: Callable[[Settings], LiveServer], folder: Path, settings: dict[str, str], token: str | None, status: int
) -> None:
    live = serve(Settings(directory=folder, **settings))  # type: ignore[arg-type]
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    assert httpx.get(f"{live.url}/metrics", headers=headers).status_code == status


def test_alive_and_ready(serve: Callable[[Settings], LiveServer], folder: Path) -> None:
    live = serve(Settings(directory=folder))
    assert httpx.get(f"{live.url}/healthz").json()["meshes"] == {"encoding": 0, "ready": 1, "failed": 0}
    answer = httpx.get(f"{live.url}/readyz")
    assert (answer.status_code, answer.json()["ready"], answer.json()["parts"]["library"]) == (200, True, "ok")
    live.loop.call_soon_threadsafe(live.app.parts.draining.set)
    answer = httpx.get(f"{live.url}/readyz")
    assert (answer.status_code, answer.json()["ready"]) == (503, False)
    assert answer.headers["retry-after"] == "1"
    assert httpx.get(f"{live.url}/healthz").status_code == 200
