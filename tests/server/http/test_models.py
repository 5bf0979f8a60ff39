import json

from meshtide_server.catalogue import Status
from meshtide_server.hosting.mesh import HostedMesh, MeshSource
from meshtide_server.hosting.stream import load_stream
from meshtide_server.http.models import MeshDetail, MeshSummary
from meshtide_server.store.range_reader import MemoryReader

from ..made_streams import make_stream


def test_summary_follows_the_state() -> None:
    mesh = HostedMesh("a", MeshSource("a.obj"))
    mesh.advance("levels", 1.5)
    summary = MeshSummary.of(mesh)
    assert (summary.status, summary.stage, summary.progress, summary.vertices) == ("encoding", "levels", 1.0, None)
    mesh.succeed(load_stream(MemoryReader(make_stream())))
    summary = MeshSummary.of(mesh)
    assert (summary.status, summary.stage, summary.progress, summary.vertices) == ("ready", None, 1.0, 1600)
    mesh.fail("gone")
    assert (mesh.status, MeshSummary.of(mesh).reason) == (Status.FAILED, "gone")


def test_detail_is_strict_json() -> None:
    stream = load_stream(MemoryReader(make_stream()))
    text = MeshDetail.of(HostedMesh("a", MeshSource("a.tide")), stream).model_dump_json()
    assert "NaN" not in text
    assert json.loads(text)["bytes"] == stream.size
