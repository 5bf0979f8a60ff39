import sys
from pathlib import Path

import pytest

from meshtide_codec.errors import OptionError
from meshtide_server.store import open_store
from meshtide_server.store.local import LocalStore
from meshtide_server.store.memory import MemoryStore


def test_folders(tmp_path: Path) -> None:
    for address in (tmp_path / "a b", str(tmp_path / "a b"), f"file:{tmp_path}/a%20b", f"file://{tmp_path}/a%20b"):
        store = open_store(address)
        assert isinstance(store, LocalStore)
        assert store.root == tmp_path / "a b"


def test_memory() -> None:
    assert isinstance(open_store("memory:"), MemoryStore)
    assert open_store("memory:") is not open_store("memory:")


def test_buckets() -> None:
    assert repr(open_store("s3://meshes/a/b/")) == "S3Store(s3://meshes/a/b)"


def test_a_missing_extra_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "obstore", None)
    monkeypatch.delitem(sys.modules, "meshtide_server.store.s3", raising=False)
    with pytest.raises(OptionError, match=r"pip install 'meshtide\[s3\]'"):
        open_store("s3://meshes")


@pytest.mark.parametrize(
    "address", ["", "gs://meshes", "s3://", "s3://UPPER", "s3://meshes?x=1", "file://host/path", "memory:x", "http://x"]
)
def test_foreign_addresses_are_refused(address: str) -> None:
    with pytest.raises(OptionError, match="store"):
        open_store(address)


def test_passwords_are_not_repeated() -> None:
    with pytest.raises(OptionError) as caught:
        open_store("ftp://me:secret@host/x?token=secret")
    assert "secret" not in str(caught.value)
