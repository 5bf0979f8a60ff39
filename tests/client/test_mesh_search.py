from datetime import UTC, datetime

from meshtide_client.mesh_search import MeshSearch


def test_nothing_asked_for_is_no_parameter() -> None:
    assert MeshSearch().parameters() == []


def test_bounds_of_zero_are_asked_for() -> None:
    assert MeshSearch(smallest=0, largest=0).parameters() == [("smallest", "0"), ("largest", "0")]


def test_boxes_and_moments_are_written_exactly() -> None:
    search = MeshSearch(box=(0.1, -1, 0, 1e300, 2, 3), created_after=datetime(2026, 11, 2, 9, tzinfo=UTC))
    assert search.parameters() == [
        ("created_after", "2026-11-02T09:00:00+00:00"),
        ("box", "0.1,-1.0,0.0,1e+300,2.0,3.0"),
    ]
