import json
import os
import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_codec.effort import Effort
from meshtide_server.encoding_options import EncodingOptions
from meshtide_server.hosting import stream_cache
from meshtide_server.hosting.stream import StoppedError
from meshtide_server.hosting.stream_cache import (
    ABANDONED_SECONDS,
    CachePlace,
    cache_folders,
    codec_digest,
    file_digest,
    is_writable,
    name_prefix,
    stream_key,
    user_cache_folder,
)

OPTIONS = EncodingOptions(bits=12)
HIGH = EncodingOptions(bits=12, effort=Effort.HIGH)


def no_scratch() -> Path:
    raise AssertionError("a temporary folder was asked for")


def test_key_depends_on_content_options_and_codec(monkeypatch: pytest.MonkeyPatch) -> None:
    keys = {stream_key("a", OPTIONS), stream_key("b", OPTIONS), stream_key("a", EncodingOptions(bits=10))}
    keys.add(stream_key("a", HIGH))
    monkeypatch.setattr(stream_cache, "codec_digest", lambda: "another encoder")
    keys.add(stream_key("a", OPTIONS))
    monkeypatch.setattr(stream_cache, "FORMAT_VERSION", 99)
    keys.add(stream_key("a", OPTIONS))
    assert len(keys) == 6


def test_codec_digest_follows_the_sources_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream_cache.meshtide_codec, "__file__", str(tmp_path / "__init__.py"))

    def digest() -> str:
        codec_digest.cache_clear()
        return codec_digest()

    (tmp_path / "__init__.py").write_text("a = 1")
    first = digest()
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "mesh.cpython-311.pyc").touch()
    assert digest() == first
    (tmp_path / "__init__.py").write_text("a = 2")
    second = digest()
    (tmp_path / "table.npz").touch()
    third = digest()
    assert len({first, second, third}) == 3
    codec_digest.cache_clear()


def test_digest_follows_the_content_not_the_name(tmp_path: Path) -> None:
    for name, content in (("a.obj", "v 0 0 0"), ("b.obj", "v 0 0 0"), ("c.obj", "v 0 0 1")):
        (tmp_path / name).write_text(content)
    a, b, c = (file_digest(tmp_path / name) for name in ("a.obj", "b.obj", "c.obj"))
    assert a == b != c


def test_digest_of_gltf_covers_its_buffers(tmp_path: Path) -> None:
    path = tmp_path / "scene.gltf"
    path.write_text(json.dumps({"buffers": [{"uri": "scene.bin"}, {"uri": "data:;base64,AA=="}, {}]}))
    assert file_digest(path)
    path.write_text(json.dumps({"buffers": [{"uri": "scene.bin"}, {"uri": "data:;base64,AA=="}]}))
    before = file_digest(path)
    (tmp_path / "scene.bin").write_bytes(b"1")
    with_buffer = file_digest(path)
    (tmp_path / "scene.bin").write_bytes(b"2")
    assert len({before, with_buffer, file_digest(path)}) == 3
    path.write_text("not json")
    assert file_digest(path)


def test_digest_stops_when_told_to(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0")
    with pytest.raises(StoppedError):
        file_digest(tmp_path / "a.obj", stopping=lambda: True)


@given(st.text(min_size=1), st.text(min_size=1))
def test_prefixes_of_different_names_differ(first: str, second: str) -> None:
    first, second = first.encode(errors="ignore").decode(), second.encode(errors="ignore").decode()
    assert (name_prefix(first, OPTIONS) == name_prefix(second, OPTIONS)) == (first == second)
    assert len(name_prefix(first, OPTIONS)) < 80


def test_streams_of_one_mesh_at_different_efforts_do_not_drive_each_other_out(tmp_path: Path) -> None:
    places = [CachePlace((tmp_path,), name_prefix("spot.obj", each), stream_key("a", each)) for each in (OPTIONS, HIGH)]
    for place in places:
        assert place.find() is None
        place.paths[0].touch()
    for place in places:
        place.prune()
    assert [place.find() for place in places] == [place.paths[0] for place in places]
    assert places[0].paths != places[1].paths


def test_place_prefers_the_first_folder_and_finds_in_all(tmp_path: Path) -> None:
    folders = (tmp_path / "one", tmp_path / "two")
    for folder in folders:
        folder.mkdir()
    place = CachePlace(folders, "spot-obj-00000000-b12", "key")
    assert place.find() is None
    place.paths[1].touch()
    assert place.find() == place.paths[1]
    place.paths[0].touch()
    assert place.find() == place.paths[0]


def test_prune_deletes_only_stale_files_of_this_mesh(tmp_path: Path) -> None:
    place = CachePlace((tmp_path, tmp_path / "missing"), "spot-00000000-b12", "new")
    kept = [
        "spot-00000000-b12.new.tide",
        "spot-00000000-b10.old.tide",
        "other-00000000-b12.old.tide",
        "spot.tide",
        ".spot-00000000-b12.new.tide.x.part",
    ]
    stale = ["spot-00000000-b12.old.tide", ".spot-00000000-b12.old.tide.y.part"]
    for name in kept + stale:
        (tmp_path / name).touch()
    old = time.time() - ABANDONED_SECONDS - 1
    os.utime(tmp_path / stale[1], (old, old))
    place.prune()
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(kept)


def test_streams_go_beside_the_meshes_by_default(tmp_path: Path, private_cache: Path) -> None:
    folders = cache_folders(tmp_path, None, no_scratch)
    assert folders[0] == tmp_path / ".meshtide"
    assert private_cache in folders[1].parents
    assert not folders[1].exists()


def test_streams_go_to_the_user_cache_when_the_folder_cannot_be_written(tmp_path: Path, private_cache: Path) -> None:
    (tmp_path / ".meshtide").write_text("a file where the folder should be")
    folders = cache_folders(tmp_path, None, no_scratch)
    assert private_cache in folders[0].parents
    assert folders[1] == tmp_path / ".meshtide"


def test_two_folders_of_one_name_do_not_share_a_user_cache(tmp_path: Path) -> None:
    chosen = tmp_path / "cache"
    homes = set()
    for parent in ("a", "b"):
        directory = tmp_path / parent / "meshes"
        directory.mkdir(parents=True)
        homes.add(cache_folders(directory, chosen, no_scratch)[0])
    homes.add(cache_folders(None, chosen, no_scratch)[0])
    assert len(homes) == 3
    assert all(home.parent == chosen for home in homes)


def test_a_chosen_cache_that_cannot_be_written_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    chosen = tmp_path / "file"
    chosen.write_text("not a folder")
    folders = cache_folders(tmp_path, chosen, lambda: tmp_path / "scratch")
    assert folders[0] == tmp_path / "scratch"
    told = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert "no streams can be stored in" in told[0]
    assert "then lost; a writable --cache would keep them" in told[1]


def test_is_writable_tells_why_not(tmp_path: Path) -> None:
    assert is_writable(tmp_path / "new" / "folder") is None
    (tmp_path / "file").touch()
    assert is_writable(tmp_path / "file") == "File exists"


def test_user_cache_folder_follows_the_environment(private_cache: Path) -> None:
    assert user_cache_folder() == private_cache / "meshtide" / "streams"
