import json

from meshtide_server.hosted_mesh import HostedMesh, Source, Status
from meshtide_server.hosted_stream import load_stream
from meshtide_server.models import MeshDetail, MeshSummary, plain
from meshtide_server.storage import MemoryStorage

from .conftest import make_stream


def test_summary_follows_the_state() -> None:
    mesh = HostedMesh("a", Source("a.obj"))
    mesh.advance("levels", 1.5)
    summary = MeshSummary.of(mesh)
    assert (summary.status, summary.stage, summary.progress, summary.vertices) == ("encoding", "levels", 1.0, None)
    mesh.succeed(load_stream(MemoryStorage(make_stream())))
    summary = MeshSummary.of(mesh)
    assert (summary.status, summary.stage, summary.progress, summary.vertices) == ("ready", None, 1.0, 1600)
    mesh.fail("gone")
    assert (mesh.status, MeshSummary.of(mesh).reason) == (Status.FAILED, "gone")


def test_detail_is_strict_json() -> None:
    stream = load_stream(MemoryStorage(make_stream()))
    text = MeshDetail.of(HostedMesh("a", Source("a.tide")), stream).model_dump_json()
    assert "NaN" not in text
    assert json.loads(text)["bytes"] == stream.size


def test_plain_keeps_what_json_knows() -> None:
    value = {"a": [1, 2.5, None, True, "x"], "b": {"c": []}}
    assert plain(value) == value
    assert plain({1: float("nan"), "b": (b"\x01",)}) == {"1": "nan", "b": ["01"]}
