import os
from pathlib import Path

import pytest

from meshtide_server.hosting import folder_listing
from meshtide_server.hosting.folder_listing import DEEPEST, list_sources


def put(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)


def listed(folder: Path, *, recursive: bool = True) -> list[str]:
    return [str(source.path.relative_to(folder)) for source in list_sources(folder, recursive=recursive) if source.path]


def test_streams_come_first_and_subfolders_only_if_they_are_wanted(tmp_path: Path) -> None:
    put(tmp_path, "b.obj", "a/c.ply", "a/d/e.tide", "z.TIDE", "notes.txt", ".f.obj", ".g/h.obj", "a/.i/j.obj")
    assert listed(tmp_path, recursive=False) == ["z.TIDE", "b.obj"]
    assert listed(tmp_path) == ["a/d/e.tide", "z.TIDE", "a/c.ply", "b.obj"]


def test_nothing_outside_is_reached_by_links(tmp_path: Path) -> None:
    home, outside = tmp_path / "home", tmp_path / "outside"
    put(outside, "secret.obj", "more/secret.ply")
    put(home, "a/vase.obj")
    (home / "secret.obj").symlink_to(outside / "secret.obj")
    (home / "up.obj").symlink_to("../outside/secret.obj")
    (home / "more").symlink_to(outside / "more", target_is_directory=True)
    (home / "a" / "loop").symlink_to(home, target_is_directory=True)
    (home / "dangling.obj").symlink_to(home / "nowhere.obj")
    (home / "twice.obj").symlink_to(home / "up.obj")
    (home / "inside.obj").symlink_to(home / "a" / "vase.obj")
    assert listed(home) == ["a/vase.obj", "inside.obj"]
    assert listed(home, recursive=False) == ["inside.obj"]


def test_depth_and_number_are_bounded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    deepest = "/".join(map(str, range(DEEPEST)))
    put(tmp_path, f"{deepest}/a.obj", f"{deepest}/too/deep.obj", "b.obj", "c.obj")
    assert listed(tmp_path) == [f"{deepest}/a.obj", "b.obj", "c.obj"]
    monkeypatch.setattr(folder_listing, "MOST_FILES", 1)
    assert len(list_sources(tmp_path, recursive=True)) == 1
    assert "holds more than 1 meshes" in caplog.text


def test_names_that_are_no_text_hide_no_other(tmp_path: Path) -> None:
    (tmp_path / os.fsdecode(b"\xff\n.obj")).touch()
    put(tmp_path, "b.obj")
    assert [source.name for source in list_sources(tmp_path)] == ["b.obj", r"\udcff\n.obj"]


def test_a_subfolder_that_cannot_be_read_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(tmp_path, "a/b.obj", "c.obj")
    scan = os.scandir

    def refusing(folder: Path) -> object:
        if folder == refused:
            raise PermissionError(13, "Permission denied")
        return scan(folder)

    monkeypatch.setattr(os, "scandir", refusing)
    refused = tmp_path / "a"
    assert listed(tmp_path) == ["c.obj"]
    refused = tmp_path
    with pytest.raises(PermissionError):
        list_sources(tmp_path)
