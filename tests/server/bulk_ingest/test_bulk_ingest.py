"""A bulk ingest from its options to its end, with real worker processes."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Any

import psutil
import pytest

from bulk_ingests import BITS, PROFILE, chosen, expected_stream, kept_in, small_meshes
from meshtide_codec.errors import OptionError, TransferError
from meshtide_server.bulk_ingest.bulk_ingest import BulkIngest, KnownMesh

if TYPE_CHECKING:
    from pathlib import Path


def encoder_processes() -> list[psutil.Process]:
    """Those that this process has started."""
    children = psutil.Process().children()
    return [child for child in children if "meshtide_server.encoding.worker" in child.cmdline()]


def test_a_worker_that_is_killed_costs_no_file(tmp_path: Path) -> None:
    files = small_meshes(tmp_path / "scans", 10)
    (tmp_path / "scans" / "bad.obj").write_text("no mesh")
    work = BulkIngest(data=tmp_path / "kept", bits=BITS, profile=PROFILE, workers=2)
    assert work.known() == ()
    told: dict[Path, tuple[str | None, str, str | None, tuple[str, ...]]] = {}
    killed: list[int] = []

    def tell(file: Path, *rest: Any) -> None:
        told[file] = rest
        if not killed and (running := encoder_processes()):
            running[0].kill()
            killed.append(running[0].pid)

    work.run((chosen(file) for file in [*files, tmp_path / "scans" / "bad.obj"]), tell)
    assert len(killed) == 1
    assert encoder_processes() == []
    assert {file.name for file, (_, state, *_) in told.items() if state != "done"} == {"bad.obj"}
    assert "no vertices" in (told[tmp_path / "scans" / "bad.obj"][2] or "")
    found = kept_in(tmp_path / "kept")
    assert found.streams == {file.stem: expected_stream(file) for file in files}
    assert found.keys == found.expected_keys
    assert sorted(work.known(), key=lambda row: row.id) == [
        KnownMesh(file.stem, file.name, "ready", chosen(file).digest) for file in files
    ]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "nothing to host"),
        ({"store": "kept"}, "store and database belong together"),
        ({"store": "kept", "database": "mysql://host/name"}, "is not a database"),
        ({"store": "kept", "database": "postgresql://me:word@host/name"}, "set MESHTIDE_DATABASE instead"),
        ({"data": "kept", "bits": 99}, "bits"),
        ({"data": "kept", "profile": "best"}, "profile"),
        ({"data": "kept", "workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "its own affair"),
    ],
)
def test_options_that_do_not_go_together(options: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError, match=words) as caught:
        BulkIngest(**options)
    assert "me:word" not in str(caught.value)


def test_a_place_to_host_from_is_none_to_keep_meshes_in(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESHTIDE_SAMPLES", "true")
    with pytest.raises(OptionError, match="say where to"):
        BulkIngest()


def test_a_database_with_a_password_comes_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MESHTIDE_DATABASE", f"sqlite:///{tmp_path}/catalogue.db")
    assert BulkIngest(store=str(tmp_path / "store")).known() == ()
    assert (tmp_path / "catalogue.db").is_file()


def test_a_store_that_is_lost_at_the_end_is_refused(tmp_path: Path) -> None:
    work = BulkIngest(store="memory:", database=f"sqlite:///{tmp_path}/catalogue.db")
    with pytest.raises(OptionError, match="gone when this command ends"):
        work.run([], lambda *_: None)


def test_a_store_or_a_cluster_that_cannot_be_used_is_told_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(TransferError, match="nothing can be kept in"):
        BulkIngest(store=str(tmp_path / "file"), database=f"sqlite:///{tmp_path}/a.db").run([], lambda *_: None)


def test_without_dask_the_error_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    monkeypatch.delitem(sys.modules, "meshtide_server.bulk_ingest.dask_cluster", raising=False)
    work = BulkIngest(data=tmp_path / "kept", scheduler="tcp://127.0.0.1:9")
    with pytest.raises(OptionError, match=re.escape("pip install 'meshtide[dask]'")):
        work.run([], lambda *_: None)
