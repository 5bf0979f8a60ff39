"""Ingest into a store, by whatever is registered for it."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_client import other_packages
from meshtide_client.remote import store_ingest as module
from meshtide_client.remote.ingest_plan import Ingested
from meshtide_client.remote.store_ingest import GROUP, NAME, find_store_ingest, ingest_into_store
from meshtide_codec.errors import OptionError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

    from meshtide_client.remote.ingest_plan import Sending


def registered(monkeypatch: pytest.MonkeyPatch, *values: str) -> None:
    """Has entry points that name these."""
    points = EntryPoints(EntryPoint(NAME, value, GROUP) for value in values)
    monkeypatch.setattr(other_packages, "entry_points", points.select)


class Work:
    """Publishes every file under its own name, but for bad ones."""

    def __init__(self, **options: Any) -> None:
        self.options = options

    def known(self) -> tuple[()]:
        assert self.options == {"data": "kept"}
        return ()

    def run(
        self,
        files: Iterable[Sending],
        tell: Callable[[Path, str | None, str, str | None, tuple[str, ...]], None],
        stage: Callable[[str], None],
    ) -> None:
        for sending in files:
            stage("read")
            assert len(sending.digest) == 64
            if "bad" in sending.file.name:
                tell(sending.file, None, "failed", "no mesh", ())
            else:
                tell(sending.file, sending.file.stem, "done", None, (f"normals of {sending.file.stem}: not kept",))


def test_the_server_s_package_offers_it() -> None:
    from meshtide_server.bulk_ingest.bulk_ingest import BulkIngest

    assert find_store_ingest() is BulkIngest


def test_without_the_server_s_package_the_error_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    registered(monkeypatch)
    with pytest.raises(OptionError, match="needs the package meshtide_server, which is not installed here"):
        find_store_ingest()
    registered(monkeypatch, "meshtide_no_server.ingest:Ingest")
    with pytest.raises(OptionError, match="not installed here; No module named 'meshtide_no_server'"):
        find_store_ingest()


def test_every_file_is_told_in_its_place(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(module, "find_store_ingest", lambda: Work)
    files = [tmp_path / name for name in ("a.ply", "bad.ply", "copy.ply", "d.ply")]
    for file in files:
        file.write_text("same" if file.stem in {"a", "copy"} else file.name)
    told: list[Ingested] = []
    stages: list[str] = []
    results = ingest_into_store(files, {"data": "kept"}, progress=told.append, stage=stages.append)
    assert set(stages) == {"read"}
    assert results == [
        Ingested(files[0], "a", "done", None, ("normals of a: not kept",)),
        Ingested(files[1], None, "failed", "no mesh"),
        Ingested(files[2], "a", "kept"),
        Ingested(files[3], "d", "done", None, ("normals of d: not kept",)),
    ]
    assert sorted(told, key=lambda row: row.file) == results
