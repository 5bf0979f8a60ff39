from __future__ import annotations

import os
from pathlib import Path

import pytest

from meshtide_client.remote.folder_search import Skipped, found_below, oddity


def is_ply(path: Path) -> bool:
    return path.suffix == ".ply"


@pytest.fixture(name="scans")
def _scans(tmp_path: Path) -> Path:
    folder = tmp_path / "scans"
    (folder / "deep").mkdir(parents=True)
    (folder / "b.ply").touch()
    (folder / "deep" / "a.ply").touch()
    (folder / "notes.txt").touch()
    (folder / "linked.ply").symlink_to("b.ply")
    return folder


def test_files_are_found_at_any_depth(scans: Path) -> None:
    assert found_below(scans, is_ply) == ([scans / "b.ply", scans / "deep" / "a.ply", scans / "linked.ply"], [])


def test_what_is_no_file_is_told_with_the_reason(scans: Path, tmp_path: Path) -> None:
    os.mkfifo(scans / "deep" / "pipe.ply")
    os.mkfifo(scans / "deep" / "pipe.txt")
    (scans / "dead.ply").symlink_to("gone.ply")
    (scans / "round.ply").symlink_to("round.ply")
    (scans / "null.ply").symlink_to("/dev/null")
    (tmp_path / "other").mkdir()
    (scans / "away").symlink_to(tmp_path / "other")
    files, skipped = found_below(scans, is_ply)
    assert len(files) == 3
    assert skipped == [
        Skipped(scans / "away", "is a link to a folder, which is not followed; name it to have it"),
        Skipped(scans / "dead.ply", "is a link that leads nowhere"),
        Skipped(scans / "deep" / "pipe.ply", "is a pipe, no file"),
        Skipped(scans / "null.ply", "is a device or a socket, no file"),
        Skipped(scans / "round.ply", "is a link that leads nowhere"),
    ]


def test_a_folder_that_cannot_be_read_is_a_failure(scans: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scan = os.scandir

    def forbidden(path: str) -> object:
        if str(path).endswith("deep"):
            raise PermissionError(13, "Permission denied", str(path))
        return scan(path)

    monkeypatch.setattr(os, "scandir", forbidden)
    files, skipped = found_below(scans, is_ply)
    assert files == [scans / "b.ply", scans / "linked.ply"]
    assert skipped == [Skipped(scans / "deep", "cannot be read: Permission denied", failed=True)]


def test_files_and_folders_are_nothing_odd(scans: Path) -> None:
    assert [oddity(path) for path in (scans, scans / "b.ply", scans / "linked.ply")] == [None] * 3
    assert oddity(scans / "gone.ply") == "cannot be looked at: No such file or directory"
