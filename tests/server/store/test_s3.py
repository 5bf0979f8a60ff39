"""The S3 store against a real S3 server."""

import asyncio
import secrets
from collections.abc import Iterator
from pathlib import Path

import pytest

from meshtide_codec.errors import OptionError
from meshtide_server.store import StoreError
from meshtide_server.store.s3 import S3Store, _credentials
from meshtide_server.store.testing import StoreConformance
from s3_server import BUCKET, free_port, running_s3_server


@pytest.fixture(scope="module")
def s3_endpoint(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_s3_server(tmp_path_factory.mktemp("seaweedfs")) as endpoint:
        yield endpoint


class TestS3Store(StoreConformance):
    @pytest.fixture
    def store(self, s3_endpoint: str, monkeypatch: pytest.MonkeyPatch) -> S3Store:
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "any")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "any")
        monkeypatch.setenv("AWS_ENDPOINT_URL", s3_endpoint)
        return S3Store(BUCKET, f"test-{secrets.token_hex(8)}")


async def test_a_server_that_is_not_there_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshtide_server.store.s3.RETRY_SECONDS", 0)
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{free_port()}")
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "any")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret-word")
    async with asyncio.timeout(30):
        with pytest.raises(StoreError, match="object 'a' in s3://meshes") as caught:
            await S3Store("meshes").get("a")
    assert "secret-word" not in str(caught.value)


CREDENTIALS = """
[default]
aws_access_key_id = first
aws_secret_access_key = secret%word

[backup]
aws_access_key_id = second
aws_secret_access_key = other
aws_session_token = passing
"""


def test_credentials_may_stand_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "credentials"
    file.write_text(CREDENTIALS)
    named = {"AWS_SHARED_CREDENTIALS_FILE": str(file)}
    assert _credentials(named) == {"access_key_id": "first", "secret_access_key": "secret%word"}
    assert list(_credentials({**named, "AWS_PROFILE": "backup"}).values()) == ["second", "other", "passing"]
    assert _credentials({}) == _credentials({**named, "AWS_ACCESS_KEY_ID": "own"}) == {}
    for content in ("[default]\naws_access_key_id = secret\n", "secret", "[other]\n", "\xff"):
        file.write_bytes(content.encode("latin-1"))
        with pytest.raises(OptionError, match=r"holds no \[default\] with aws_access_key_id") as caught:
            S3Store("meshes", environment=named)
        assert "secret\n" not in str(caught.value)
    file.unlink()
    with pytest.raises(OptionError, match="cannot be read: No such file"):
        S3Store("meshes", environment=named)
