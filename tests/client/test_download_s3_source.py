from __future__ import annotations

import sys
from pathlib import Path

import pytest

from meshtide_client.connection.link import Link
from meshtide_client.download.holding import Holding
from meshtide_client.download.s3_source import S3Source, list_files
from meshtide_client.download.stream import stream
from meshtide_codec.errors import OptionError, PeerError, ProtocolError, TransferError, TruncatedError
from streams import encoded_grid
from web_server import WebServer, web_server

pytest.importorskip("obstore")

ENCODED = encoded_grid()
WHOLE = ENCODED.to_bytes()
LEVELS = [row.level for row in ENCODED.header.levels]
URL = "s3://museum/scans/vase.tide"


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_ENDPOINT", "AWS_ENDPOINT_URL", "AWS_PROFILE"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("AWS_REGION", "us-east-1")


async def levels(resume: Path | None = None) -> list[int]:
    return [level.level async for level in stream(URL, resume=resume, link=Link(retries=1, delay=0.001))]


@pytest.mark.parametrize("signed", [False, True])
async def test_buckets_are_read_with_and_without_credentials(
    signed: bool, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "vase.tide"
    if signed:
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "somebody")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret-of-somebody")
    with web_server(WebServer(WHOLE)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        assert await levels(path) == LEVELS
    assert path.read_bytes() == WHOLE
    assert server.requests[0][0] == "/museum/scans/vase.tide"
    for authorization in server.authorizations:
        assert (authorization is not None) is signed
        assert "secret-of-somebody" not in str(authorization)


async def test_a_download_from_a_bucket_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = tmp_path / "vase.tide"
    path.write_bytes(WHOLE[:-5])
    with web_server(WebServer(WHOLE)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        assert await levels(path) == LEVELS
    assert path.read_bytes() == WHOLE
    assert server.sent < len(WHOLE)


LISTING = b"""<?xml version="1.0" encoding="UTF-8"?>
<ListBucketResult><Name>museum</Name><Prefix>scans/</Prefix><KeyCount>2</KeyCount><MaxKeys>1000</MaxKeys>
<IsTruncated>false</IsTruncated>
<Contents><Key>scans/vase.tide</Key><LastModified>2020-01-01T00:00:00.000Z</LastModified><ETag>"a"</ETag>
<Size>9</Size></Contents>
<Contents><Key>scans/notes.txt</Key><LastModified>2020-01-01T00:00:00.000Z</LastModified><ETag>"b"</ETag>
<Size>9</Size></Contents>
<Contents><Key>scans/old/cup.tide</Key><LastModified>2020-01-01T00:00:00.000Z</LastModified><ETag>"c"</ETag>
<Size>9</Size></Contents></ListBucketResult>"""


def test_the_files_of_a_bucket_are_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    with web_server(WebServer(LISTING, ranges=False)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        files = list_files("s3://museum/scans", 10.0)
    assert files == ["s3://museum/scans/old/cup.tide", "s3://museum/scans/vase.tide"]
    assert "prefix=scans" in server.requests[0][0]
    with web_server(WebServer(b"", status=403, problem=b"<Error/>")) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises(TransferError, match="cannot list s3://museum/scans: .*403"):
            list_files("s3://museum/scans", 10.0)


def test_without_the_extra_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "obstore", None)
    with pytest.raises(OptionError, match=r"pip install 'meshtide\[s3\]'"):
        S3Source(URL, 10.0)


@pytest.mark.parametrize(
    ("status", "error", "message"),
    [
        (404, ProtocolError, "there is no s3://museum/scans/vase.tide"),
        (403, PeerError, "may not be read"),
        (500, TransferError, "cannot read s3://museum"),
    ],
)
async def test_refusals_are_told(
    status: int, error: type[Exception], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with web_server(WebServer(WHOLE, status=status, problem=b"<Error/>")) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises(error, match=message):
            await levels()


async def test_an_object_that_changes_between_two_requests_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    with web_server(WebServer(WHOLE, heedless=True)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        source = S3Source(URL, 5.0)
        async with source.read(0, 10) as reading:
            assert b"".join([piece async for piece in reading.pieces]) == WHOLE[:10]
        server.tag = '"second"'
        with pytest.raises(TransferError, match="has changed while it was read"):
            async with source.read(10, 20):
                pass
        async with source.read(10, 20) as reading:
            assert b"".join([piece async for piece in reading.pieces]) == WHOLE[10:20]


@pytest.mark.parametrize("held", [0, 1, 3])
async def test_an_object_that_ends_early_is_told_with_what_is_missing(
    held: int, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    count = len(ENCODED.header.packets)
    left = sum(entry.length for entry in ENCODED.header.packets[held:])
    part = WHOLE[: len(WHOLE) - left + 1]
    path = tmp_path / "kept.tide"
    with web_server(WebServer(part)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises(TruncatedError, match=rf"{count - held} of {count} packets are missing \({left} bytes"):
            await levels(path)
    assert path.read_bytes() == part[:-1]


@pytest.mark.parametrize("shift", [-1, 1])
async def test_wrong_ranges_of_a_bucket_are_refused(shift: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with web_server(WebServer(WHOLE, shift=shift)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises((TransferError, ProtocolError)):
            async with S3Source(URL, 5.0).read(100, 110):
                pass


async def test_what_cannot_be_kept_is_no_failure_of_the_store(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Holding, "append", refuse)
    with web_server(WebServer(WHOLE)) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.url)
        with pytest.raises(OSError, match="No space left"):
            await levels()
    assert len(server.requests) == 1  # it is not tried again
