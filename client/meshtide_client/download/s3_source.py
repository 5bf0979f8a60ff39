"""A `.tide` file in an S3-compatible object store, read with obstore (extra `s3`).

Credentials, region and endpoint come from the environment as other programs have them (AWS_ACCESS_KEY_ID,
AWS_SECRET_ACCESS_KEY, AWS_REGION, AWS_ENDPOINT_URL ...); without an access key, requests are not signed, which is what
public buckets want.
"""

from __future__ import annotations

import os
from contextlib import asynccontextmanager, contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from meshtide_client.connection.tide_address import SUFFIX
from meshtide_client.connection.tls import named_authorities
from meshtide_client.download.byte_source import Reading
from meshtide_codec.errors import PeerError, ProtocolError, TransferError
from meshtide_codec.extras import extra

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator, Sequence
    from pathlib import Path

_CREDENTIALS = ("AWS_ACCESS_KEY_ID", "AWS_WEB_IDENTITY_TOKEN_FILE", "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI")


class S3Source:
    """A file in a bucket.

    Args:
        url: such as ``s3://bucket/scans/vase.tide``.
        timeout: seconds that one request may take to begin.
        ca_file: of authorities that vouch for the store, besides those of the machine.

    Raises:
        MissingLibraryError: the library for S3 is not installed.
    """

    name = "s3"

    def __init__(self, url: str, timeout: float, ca_file: Path | str | None = None) -> None:
        parts = urlsplit(url)
        self._url = url
        self._key = parts.path.lstrip("/")
        self._tag: str | None = None
        self._obstore, self._store = _open(parts.netloc, timeout, ca_file)
        self._errors = self._obstore.exceptions

    @asynccontextmanager
    async def read(self, start: int, end: int | None) -> AsyncIterator[Reading]:
        """See ByteSource."""
        options: dict[str, Any] = {"range": {"offset": start} if end is None else (start, end)}
        if self._tag is not None:
            options["if_match"] = self._tag
        with self._explained():
            answer = await self._obstore.get_async(self._store, self._key, options=options)
        self._check_same(answer.meta.get("e_tag"))
        if answer.range[0] != start or (end is not None and answer.range[1] > end):
            raise ProtocolError(f"{self._url} answers with another range than the one that was asked for")
        yield Reading(start, ranged=True, pieces=self._pieces(answer), size=answer.meta["size"])

    async def _pieces(self, answer: Any) -> AsyncIterator[bytes]:  # noqa: ANN401 - obstore is an extra
        with self._explained():
            async for piece in answer.stream():
                yield bytes(piece)

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """What goes wrong with a request or its answer, as errors of the tree."""
        try:
            yield
        except FileNotFoundError as error:
            raise ProtocolError(f"there is no {self._url}; check the address") from error
        except (self._errors.UnauthenticatedError, self._errors.PermissionDeniedError) as error:
            message = f"{self._url} may not be read with the credentials of the environment (AWS_ACCESS_KEY_ID ...)"
            raise PeerError("unauthorized", message) from error
        except self._errors.PreconditionError as error:
            self._tag = None
            raise TransferError(f"{self._url} has changed while it was read") from error
        except (self._errors.BaseError, OSError) as error:
            raise TransferError(f"cannot read {self._url}: {_first_line(error)}") from error

    def _check_same(self, tag: str | None) -> None:
        """The object has to be the one that the first answer was of."""
        if self._tag is not None and tag != self._tag:
            self._tag = None
            raise TransferError(f"{self._url} has changed while it was read")
        self._tag = tag

    async def close(self) -> None:
        """The store closes its connections by itself."""


def list_files(url: str, timeout: float, ca_file: Path | str | None = None) -> Sequence[str]:
    """The URLs of all `.tide` files below `url`, such as ``s3://bucket/scans``, in order.

    Raises:
        MissingLibraryError: the library for S3 is not installed.
        TransferError: the bucket cannot be read.
    """
    parts = urlsplit(url)
    obstore, store = _open(parts.netloc, timeout, ca_file)
    prefix = parts.path.strip("/")
    try:
        keys = [entry["path"] for page in obstore.list(store, prefix or None) for entry in page]
    except (obstore.exceptions.BaseError, OSError) as error:
        raise TransferError(f"cannot list {url}: {_first_line(error)}") from error
    return sorted(f"s3://{parts.netloc}/{key}" for key in keys if key.endswith(SUFFIX))


def _open(bucket: str, timeout: float, ca_file: Path | str | None) -> tuple[Any, Any]:
    """The module obstore and a store for the bucket."""
    obstore, stores = extra("obstore", "s3"), extra("obstore.store", "s3")
    settings: dict[str, Any] = {}
    options: dict[str, Any] = {"timeout": timedelta(seconds=timeout)}
    if (authorities := named_authorities(ca_file)) is not None:
        options["root_certificate"] = authorities
    endpoint = os.environ.get("AWS_ENDPOINT_URL") or os.environ.get("AWS_ENDPOINT")
    if endpoint:
        settings["endpoint"] = endpoint
        options["allow_http"] = endpoint.startswith("http://")
    if not any(os.environ.get(name) for name in _CREDENTIALS):
        settings["skip_signature"] = True
    store = stores.S3Store(bucket, client_options=options, retry_config={"max_retries": 0}, **settings)
    return obstore, store


def _first_line(error: Exception) -> str:
    return str(error).partition("\n")[0][:300]
