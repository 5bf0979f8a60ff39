from datetime import UTC, datetime

from meshtide_codec.stream.mesh_query import MeshQuery
from meshtide_server.catalogue import Box, MeshRecord, Status
from meshtide_server.hosting.mesh import HostedMesh, MeshSource
from meshtide_server.hosting.search import box_of, chosen
from meshtide_server.hosting.stream import load_stream
from meshtide_server.store.range_reader import MemoryReader

from ..made_streams import make_stream

MESHES = [
    HostedMesh(
        name,
        MeshSource(f"{name}.obj"),
        record=MeshRecord(
            name,
            f"{name}.obj",
            tags,
            licence=licence,
            box=Box((0, 0, 0), (1, 1, 1)),
            created=datetime(2020, 1, day, tzinfo=UTC),
        ),
    )
    for day, (name, tags, licence) in enumerate(
        (("amphora", ("clay",), "CC BY 4.0"), ("bust", ("clay", "marble"), "CC BY-SA"), ("column", (), "")), start=1
    )
]


def ids(**search: object) -> list[str]:
    return [mesh.id for mesh in chosen(MeshQuery(**search), MESHES)]  # type: ignore[arg-type]


def test_words_and_tags() -> None:
    assert ids() == ["amphora", "bust", "column"]
    assert ids(text="CLAY") == ids(tags=("clay",)) == ["amphora", "bust"]
    assert ids(text="BUST clay") == ["bust"]
    assert ids(tags=("clay", "marble")) == ["bust"]


def test_what_is_not_known_is_not_within_bounds() -> None:
    assert ids(smallest=0) == ids(most_vertices=10) == []
    assert ids(status=Status.ENCODING) == ["amphora", "bust", "column"]
    assert box_of(HostedMesh("a", MeshSource("a"))) is None


def test_terms_and_moments() -> None:
    assert ids(licence="by CC") == ["amphora", "bust"]
    assert ids(licence="cc by nd") == []
    assert ids(created_after=datetime(2020, 1, 1, tzinfo=UTC)) == ["bust", "column"]
    assert ids(created_before=datetime(2020, 1, 2, tzinfo=UTC)) == ["amphora"]
    folder_mesh = HostedMesh("a", MeshSource("a"))
    assert chosen(MeshQuery(created_before=datetime(2999, 1, 1, tzinfo=UTC)), [folder_mesh]) == []
    assert chosen(MeshQuery(licence="cc"), [folder_mesh]) == []


def test_levels() -> None:
    ready = HostedMesh("a", MeshSource("a"))
    ready.succeed(load_stream(MemoryReader(make_stream())))
    assert chosen(MeshQuery(fewest_levels=3, most_levels=3), [ready]) == [ready]
    assert chosen(MeshQuery(fewest_levels=4), [ready]) == chosen(MeshQuery(most_levels=2), [ready]) == []


def test_boxes_that_touch() -> None:
    assert len(ids(box=(1, 1, 1, 2, 2, 2))) == 3
    assert ids(box=(1.1, 0, 0, 2, 1, 1)) == []
