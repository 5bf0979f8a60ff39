"""A store in a bucket of Amazon S3 or of any server that speaks its protocol, through obstore (extra `s3`).

Credentials and addresses come from the environment, as with every program that uses S3: AWS_ACCESS_KEY_ID,
AWS_SECRET_ACCESS_KEY, AWS_SESSION_TOKEN, AWS_REGION, AWS_ENDPOINT_URL; from the file that AWS_SHARED_CREDENTIALS_FILE
names, profile AWS_PROFILE or default; on Amazon's machines, from the machine's role.
Large objects are put in parts (multipart upload), which S3 shows only once all of them are there; a bucket should have
a rule that deletes the parts of uploads that were never completed.
"""

from __future__ import annotations

import configparser
import os
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshtide_codec.errors import OptionError
from meshtide_codec.extras import missing_library
from meshtide_server.store.errors import MissingBucketError, MissingObjectError, ObjectRangeError, StoreError
from meshtide_server.store.keys import check_key, check_prefix
from meshtide_server.store.protocol import ObjectInfo
from meshtide_server.store.range_reader import ObjectReader

try:
    import obstore
    from obstore.exceptions import BaseError, NotFoundError
    from obstore.store import S3Store as Bucket
except ImportError as error:
    raise missing_library("obstore", "s3", error, "a store at s3://") from error

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator, Mapping

    from meshtide_server.store.protocol import Data

PART_BYTES = 8 << 20
"""Bytes of one part of a large object; S3 takes 5 MiB to 5 GiB, and 10000 parts."""
CONNECT_SECONDS = 5
REQUEST_SECONDS = 60
RETRY_SECONDS = 30
"""How long failing requests are repeated before the failure is reported."""


class S3Store:
    """Objects in a bucket.

    Args:
        bucket: its name.
        prefix: folder within it, "" for the bucket itself.
        environment: where credentials and address come from.

    Raises:
        OptionError: the file of credentials cannot be read, or does not hold them.
    """

    def __init__(self, bucket: str, prefix: str = "", environment: Mapping[str, str] = os.environ) -> None:
        self._name = f"s3://{bucket}/{prefix}".rstrip("/")
        endpoint = environment.get("AWS_ENDPOINT_URL_S3") or environment.get("AWS_ENDPOINT_URL") or ""
        options: dict[str, Any] = {"endpoint": endpoint} if endpoint else {}
        options |= _credentials(environment)
        with self._translated():
            self._bucket = Bucket(
                bucket,
                prefix=prefix or None,
                client_options={
                    "allow_http": endpoint.startswith("http://"),
                    "connect_timeout": timedelta(seconds=CONNECT_SECONDS),
                    "timeout": timedelta(seconds=REQUEST_SECONDS),
                },
                retry_config={"max_retries": 5, "retry_timeout": timedelta(seconds=RETRY_SECONDS)},
                **options,
            )

    async def get(self, key: str) -> bytes:
        """All bytes of an object."""
        with self._translated(check_key(key)):
            answer = await obstore.get_async(self._bucket, key)
            return bytes(await answer.bytes_async())

    async def get_range(self, key: str, start: int, end: int) -> bytes:
        """Bytes `start` to `end` of an object."""
        check_key(key)
        if not 0 <= start <= end:
            raise ObjectRangeError(key, start, end)
        if start == end:  # HTTP has no empty ranges
            info = await self.head(key)
            if end > info.size:
                raise ObjectRangeError(key, start, end, info.size)
            return b""
        try:
            with self._translated(key):
                data = bytes(await obstore.get_range_async(self._bucket, key, start=start, end=end))
        except MissingObjectError:
            raise
        except StoreError:
            info = await self.head(key)
            if end > info.size:
                raise ObjectRangeError(key, start, end, info.size) from None
            raise
        if len(data) != end - start:
            raise ObjectRangeError(key, start, end, start + len(data))
        return data

    async def open_range_reader(self, key: str) -> ObjectReader:
        """What reads ranges of an object."""
        return ObjectReader(self, check_key(key))

    async def put(self, key: str, data: Data) -> ObjectInfo:
        """Make or replace an object."""
        check_key(key)
        if isinstance(data, bytes):
            with self._translated(key):
                result = await obstore.put_async(self._bucket, key, data, chunk_size=PART_BYTES)
            return ObjectInfo(key, len(data), _etag(result["e_tag"]))
        first, rest = await _first_part(data)
        if rest is None:  # an empty or small object needs no parts
            return await self.put(key, first)
        counted = _Counted(first, rest)
        with self._translated(key):
            result = await obstore.put_async(self._bucket, key, counted.parts(), chunk_size=PART_BYTES)
        return ObjectInfo(key, counted.size, _etag(result["e_tag"]))

    async def list(self, prefix: str = "", *, after: str = "") -> AsyncIterator[ObjectInfo]:
        """The objects in a folder, in the order of their names."""
        folder = check_prefix(prefix)
        with self._translated(prefix):
            stream = obstore.list(self._bucket, folder or None, offset=after or None)
            async for page in stream:
                for row in page:
                    yield ObjectInfo(row["path"], row["size"], _etag(row["e_tag"]))

    async def head(self, key: str) -> ObjectInfo:
        """What is known of an object."""
        with self._translated(check_key(key)):
            row = await obstore.head_async(self._bucket, key)
        return ObjectInfo(key, row["size"], _etag(row["e_tag"]))

    async def delete(self, key: str) -> None:
        """Remove an object."""
        with self._translated(check_key(key)):
            try:
                await obstore.delete_async(self._bucket, key)
            except (NotFoundError, FileNotFoundError):
                return

    async def close(self) -> None:
        """Nothing to let go of: connections end when they are idle."""

    @contextmanager
    def _translated(self, key: str = "") -> Iterator[None]:
        """Obstore's errors become this package's own."""
        try:
            yield
        except (NotFoundError, FileNotFoundError) as error:
            raise MissingObjectError(key) from error
        except (BaseError, OSError) as error:
            if "<Code>NoSuchBucket</Code>" in str(error):
                raise MissingBucketError(f"there is no bucket {self._name}; make it, or name another one") from error
            reason = str(error).strip().split("\n", maxsplit=1)[0]
            raise StoreError(f"object {key!r} in {self._name}: {reason}") from error

    def __repr__(self) -> str:
        return f"S3Store({self._name})"


class _Counted:
    """What is put, and how many bytes of it have gone by."""

    def __init__(self, first: bytes, rest: AsyncIterator[bytes]) -> None:
        self._first = first
        self._rest = rest
        self.size = 0

    async def parts(self) -> AsyncIterator[bytes]:
        self.size = len(self._first)
        yield self._first
        async for part in self._rest:
            self.size += len(part)
            if part:
                yield part


async def _first_part(data: AsyncIterator[bytes]) -> tuple[bytes, AsyncIterator[bytes] | None]:
    """The first PART_BYTES or more of `data`, and what yields the rest; None if that was all."""
    first = bytearray()
    async for part in data:
        first += part
        if len(first) >= PART_BYTES:
            return bytes(first), data
    return bytes(first), None


def _credentials(environment: Mapping[str, str]) -> dict[str, str]:
    """Those of the file of credentials, if one is named and the environment itself holds none."""
    name = environment.get("AWS_SHARED_CREDENTIALS_FILE", "")
    if not name or environment.get("AWS_ACCESS_KEY_ID"):
        return {}
    parser = configparser.ConfigParser(interpolation=None)
    profile = environment.get("AWS_PROFILE") or "default"
    try:
        with Path(name).open(encoding="utf-8") as file:
            parser.read_file(file)
        section = parser[profile]
        found = {
            "access_key_id": section["aws_access_key_id"],
            "secret_access_key": section["aws_secret_access_key"],
        }
        return found | ({"token": section["aws_session_token"]} if "aws_session_token" in section else {})
    except OSError as error:
        raise OptionError(f"the credentials in {name} cannot be read: {error.strerror or error}") from error
    except (configparser.Error, KeyError, UnicodeDecodeError):  # whose messages may repeat a line of it
        message = f"{name} holds no [{profile}] with aws_access_key_id and aws_secret_access_key"
        raise OptionError(message) from None


def _etag(quoted: str | None) -> str:
    return (quoted or "").strip('"')
