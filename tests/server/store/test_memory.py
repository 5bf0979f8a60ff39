import pytest

from meshtide_server.store.memory import MemoryStore

from ..store_conformance import StoreConformance


class TestMemoryStore(StoreConformance):
    @pytest.fixture
    def store(self) -> MemoryStore:
        return MemoryStore()
