import re
from urllib.parse import quote

from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.stream.messages import LONGEST_MESH_ID
from meshtide_server.hosting.identifiers import LONGEST_ID, is_id, path_id, slug, unique_id


@given(st.text())
def test_slug_is_one_safe_path_segment(name: str) -> None:
    made = slug(name)
    assert re.fullmatch(r"[a-z0-9_]([a-z0-9_-]*[a-z0-9_])?", made)
    assert quote(made, safe="") == made
    assert len(made) <= LONGEST_ID
    assert slug(made) == made


@given(st.lists(st.tuples(st.text(max_size=150), st.sampled_from([".obj", ".tide", ".PLY"])), max_size=30))
def test_ids_are_unique_and_fit_a_hello(files: list[tuple[str, str]]) -> None:
    taken: set[str] = set()
    for stem, suffix in files:
        made = unique_id(stem, suffix, taken)
        assert made not in taken
        assert len(made) <= LONGEST_MESH_ID
        taken.add(made)
    assert len(taken) == len(files)


@given(
    st.lists(st.text(min_size=1, max_size=120), max_size=8),
    st.lists(st.text(max_size=150) | st.sampled_from(["header", "stream", "a"]), min_size=1, max_size=12),
)
def test_ids_of_files_in_subfolders(folders: list[str], stems: list[str]) -> None:
    taken: set[str] = set()
    for stem in stems:
        made = path_id(folders, stem, ".obj", taken)
        assert made not in taken
        assert len(made) <= LONGEST_MESH_ID
        assert all(is_id(part) for part in made.split("/"))
        assert made.count("/") == len(folders)
        assert not folders or made.rpartition("/")[2] not in {"header", "stream"}
        taken.add(made)
