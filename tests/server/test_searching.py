from datetime import UTC, datetime

import pytest

from meshtide_server.catalogue import Box, MeshRecord, MeshState
from meshtide_server.hosted_mesh import HostedMesh, Source, Status
from meshtide_server.hosted_stream import load_stream
from meshtide_server.searching import Search, box_of, parse_box
from meshtide_server.storage import MemoryStorage

from .conftest import make_stream

MESHES = [
    HostedMesh(
        name,
        Source(f"{name}.obj"),
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
    return [mesh.id for mesh in Search(**search).chosen(MESHES)]  # type: ignore[arg-type]


def test_words_and_tags() -> None:
    assert ids() == ["amphora", "bust", "column"]
    assert ids(text="CLAY") == ids(tags=("clay",)) == ["amphora", "bust"]
    assert ids(text="BUST clay") == ["bust"]
    assert ids(tags=("clay", "marble")) == ["bust"]


def test_what_is_not_known_is_not_within_bounds() -> None:
    assert ids(smallest=0) == ids(most_vertices=10) == []
    assert ids(status=Status.ENCODING) == ["amphora", "bust", "column"]
    assert box_of(HostedMesh("a", Source("a"))) is None


def test_terms_and_moments() -> None:
    assert ids(licence="by CC") == ["amphora", "bust"]
    assert ids(licence="cc by nd") == []
    assert ids(created_after=datetime(2020, 1, 1, tzinfo=UTC)) == ["bust", "column"]
    assert ids(created_before=datetime(2020, 1, 2, tzinfo=UTC)) == ["amphora"]
    folder_mesh = HostedMesh("a", Source("a"))
    assert Search(created_before=datetime(2999, 1, 1, tzinfo=UTC)).chosen([folder_mesh]) == []
    assert Search(licence="cc").chosen([folder_mesh]) == []


def test_levels() -> None:
    ready = HostedMesh("a", Source("a"))
    ready.succeed(load_stream(MemoryStorage(make_stream())))
    assert Search(fewest_levels=3, most_levels=3).chosen([ready]) == [ready]
    assert Search(fewest_levels=4).chosen([ready]) == Search(most_levels=2).chosen([ready]) == []


def test_the_catalogue_is_asked_the_same() -> None:
    box = Box((0, 0, 0), (1, 1, 1))
    query = Search("old vase", ("clay",), "cc", Status.READY, smallest=3, most_levels=4, box=box, after="a").query()
    assert (query.text, query.tags, query.licence, query.states) == ("old vase", ("clay",), "cc", (MeshState.READY,))
    assert (query.smallest, query.most_levels, query.box, query.after) == (3, 4, box, "a")
    assert Search().query().states == ()


def test_boxes_that_touch() -> None:
    assert len(ids(box=Box((1, 1, 1), (2, 2, 2)))) == 3
    assert ids(box=Box((1.1, 0, 0), (2, 1, 1))) == []


@pytest.mark.parametrize("text", ["", "1", "1,2,3,4,5", "1,2,3,4,5,6,7", "a,b,c,d,e,f", "inf,0,0,1,1,1", "0," * 200])
def test_foreign_boxes_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r"six numbers|convert"):
        parse_box(text)
