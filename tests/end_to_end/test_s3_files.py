"""`.tide` files in a bucket of a real S3 server."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from meshtide_codec.command_line import ExitCode
from s3_server import BUCKET, running_s3_server

if TYPE_CHECKING:
    from collections.abc import Iterator

obstore = pytest.importorskip("obstore")

URL = f"s3://{BUCKET}/scans/patch.tide"


@pytest.fixture(scope="module", name="endpoint")
def _endpoint(encoded: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A server that holds one file."""
    from obstore.store import S3Store

    with running_s3_server(tmp_path_factory.mktemp("seaweedfs")) as endpoint:
        store = S3Store(
            BUCKET,
            endpoint=endpoint,
            access_key_id="any",
            secret_access_key="any",  # noqa: S106 - this server takes them all
            client_options={"allow_http": True},
        )
        obstore.put(store, "scans/patch.tide", encoded.to_bytes())
        yield endpoint


@pytest.mark.parametrize("signed", [True, False])
def test_a_file_in_a_bucket_is_fetched(
    signed: bool, endpoint: str, encoded: Any, meshtide: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        if signed:
            monkeypatch.setenv(name, "any")
        else:
            monkeypatch.delenv(name, raising=False)
    first = meshtide("fetch", URL, "--stream-file", "s.tide", "--until-level", "2", "--json")
    assert first.returncode == ExitCode.OK, first.stderr
    answer = json.loads(first.stdout)
    assert (answer["transport"], answer["level"], answer["complete"]) == ("s3", 2, False)
    held = (meshtide.folder / "s.tide").stat().st_size
    rest = json.loads(meshtide("fetch", URL, "--stream-file", "s.tide", "--overwrite", "--json").stdout)
    whole = encoded.to_bytes()
    assert (meshtide.folder / "s.tide").read_bytes() == whole
    assert held <= answer["received_bytes"] < len(whole)
    assert rest["received_bytes"] < len(whole)
    missing = meshtide("fetch", f"s3://{BUCKET}/scans/teapot.tide")
    assert missing.returncode == ExitCode.NETWORK
    assert "there is no s3://meshes/scans/teapot.tide" in missing.stderr


def test_a_bucket_is_exported(endpoint: str, encoded: Any, meshtide: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    monkeypatch.setenv("AWS_REGION", "us-east-1")
    done = meshtide("export", f"s3://{BUCKET}/scans", "--static", "site", "--json")
    assert done.returncode == ExitCode.OK, done.stderr
    assert [mesh["id"] for mesh in json.loads(done.stdout)["meshes"]] == ["patch"]
    assert (meshtide.folder / "site" / "meshes" / "patch.tide").read_bytes() == encoded.to_bytes()
