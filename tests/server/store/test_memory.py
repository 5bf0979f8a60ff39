import pytest

from meshtide_server.store.memory import MemoryStore
from meshtide_server.store.testing import StoreConformance


class TestMemoryStore(StoreConformance):
    @pytest.fixture
    def store(self) -> MemoryStore:
        return MemoryStore()
