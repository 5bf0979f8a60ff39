from __future__ import annotations

from types import SimpleNamespace

import pytest

from meshtide_client.download.pace import Pace


@pytest.mark.parametrize(("rate", "expected"), [(100.0, [0.5, 1.5, 0.0]), (None, [])])
async def test_waits_are_until_the_bytes_are_due(
    rate: float | None, expected: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What came late is not waited for: the rate holds for all bytes from the start."""
    now = 7.0
    waits: list[float] = []

    async def sleep(seconds: float) -> None:
        waits.append(seconds)

    monkeypatch.setattr("meshtide_client.download.pace.time", SimpleNamespace(monotonic=lambda: now))
    monkeypatch.setattr("meshtide_client.download.pace.asyncio", SimpleNamespace(sleep=sleep))
    pace = Pace(rate)
    await pace.take(50)
    now += 0.5
    await pace.take(150)
    now += 9.0
    await pace.take(10)
    assert waits == expected
