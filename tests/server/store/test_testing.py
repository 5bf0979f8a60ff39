"""The conformance suite itself: it finds what is wrong with a store."""

import importlib
import sys
from dataclasses import replace

import pytest

from meshtide_codec.errors import MeshtideError
from meshtide_server.store import ObjectInfo, testing
from meshtide_server.store.memory import MemoryStore
from meshtide_server.store.protocol import Data


class Forgetful(MemoryStore):
    """Tells the same tag of all bytes."""

    async def put(self, key: str, data: Data) -> ObjectInfo:
        return replace(await super().put(key, data), etag="same")


class Generous(MemoryStore):
    """Gives what there is of a range."""

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        return (await self.get(key))[start:end]


async def test_a_store_that_does_not_conform_is_found() -> None:
    suite = testing.StoreConformance()
    with pytest.raises(AssertionError):
        await suite.test_putting_again_replaces(Forgetful())
    with pytest.raises(pytest.fail.Exception, match="DID NOT RAISE"):
        await suite.test_ranges_outside_are_refused(Generous(), 0, 101)


@pytest.mark.parametrize("missing", ["pytest_asyncio", "hypothesis"])
def test_a_missing_library_is_told(monkeypatch: pytest.MonkeyPatch, missing: str) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    monkeypatch.delitem(sys.modules, testing.__name__)
    with pytest.raises(MeshtideError, match=rf"needs {missing}: pip install 'meshtide\[testing\]'"):
        importlib.import_module(testing.__name__)
