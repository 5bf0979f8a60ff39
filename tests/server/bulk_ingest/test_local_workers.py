from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from meshtide_server.bulk_ingest import local_workers
from meshtide_server.bulk_ingest.encode_file import FileOutcome
from meshtide_server.bulk_ingest.local_workers import LocalWorkers

if TYPE_CHECKING:
    import pytest


async def test_no_more_files_are_encoded_at_a_time_than_there_are_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    busy: list[int] = []
    most = 0

    async def encode_file(task: Any, *, progress: Any) -> FileOutcome:
        nonlocal most
        progress("levels", 0.5)
        busy.append(task)
        most = max(most, len(busy))
        await asyncio.sleep(0.01)
        busy.remove(task)
        return FileOutcome(bytes([task]))

    monkeypatch.setattr(local_workers, "encode_file", encode_file)
    stages: list[str] = []
    workers = LocalWorkers(3, stages.append)
    outcomes = await asyncio.gather(*(workers.encode(number) for number in range(10)))  # type: ignore[arg-type]
    await workers.close()
    assert outcomes == [FileOutcome(bytes([number])) for number in range(10)]
    assert most == 3
    assert stages == ["levels"] * 10
    assert workers.capacity > 3
