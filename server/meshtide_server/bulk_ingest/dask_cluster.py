"""Encoding on a Dask cluster (extra `dask`): the same function, run by the workers of a scheduler.

A worker that sees the file under the same path reads it there; to others its content is sent with the task, by way of
the scheduler, which keeps it until the task is done. So what a worker has when it dies is all somewhere else: the
scheduler gives its tasks to other workers. A task whose workers died `allowed-failures` times (Dask's setting, 3) is
begun once more from here, for it may have been in bad company, and then its file has failed.
"""

from __future__ import annotations

import asyncio
import hashlib
import logging
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Self

from meshtide_codec.errors import OptionError, TransferError
from meshtide_codec.extras import missing_library
from meshtide_server.bulk_ingest.encode_file import FileOutcome, encode_file

try:
    import dask
    from distributed import CancelledError as TaskCancelledError
    from distributed import Client, KilledWorker
except ImportError as import_error:
    raise missing_library("distributed", "dask", import_error, "--distributed") from import_error

if TYPE_CHECKING:
    from meshtide_server.bulk_ingest.encode_file import FileTask

WATCH_SECONDS = 1.0
"""How often the scheduler is asked for its workers."""
SUBMISSIONS = 2
FEWEST_WAITING = 32
"""Tasks that wait at the scheduler at least, so that a cluster that grows by demand sees some."""
LOST = "the connection to the Dask scheduler was lost; run it again"
CONTENT_BYTES = 256 << 20
"""Content of files that is on its way, or kept by the scheduler, at a time; one file may be larger."""


class DaskCluster:
    """The workers of a Dask scheduler; make one with `DaskCluster.connect`.

    Args:
        client: a Dask client, connected and asynchronous.
        patience: seconds without any worker after which the cluster counts as lost.
    """

    def __init__(self, client: Client, patience: float) -> None:
        self._client: Any = client  # its methods are typed as those of a client that blocks
        self._patience = patience
        self._threads = 1
        self._send_contents = False
        self._sent = 0
        self._room = asyncio.Condition()
        self._lost = asyncio.create_task(self._watch(), name="watch the cluster")

    @classmethod
    async def connect(cls, address: str, patience: float) -> Self:
        """Connect to a scheduler that has workers.

        Args:
            address: such as ``tcp://host:8786``.
            patience: seconds to wait for the scheduler, and for a first worker.

        Raises:
            OptionError: it is not an address of a scheduler.
            TransferError: there is no scheduler, or it has no workers.
        """
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # this class reports a lost connection
        dask.config.set({"distributed.admin.large-graph-warning-threshold": CONTENT_BYTES * 1024})
        client: Any = Client(address, asynchronous=True, timeout=patience, set_as_default=False)
        try:
            await client
            await client.wait_for_workers(1, timeout=patience)
        except BaseException as error:
            connected = client.status == "running"
            await client.close()
            if isinstance(error, ValueError):
                raise OptionError(
                    f"{address!r} is not an address of a Dask scheduler, tcp://host:8786: {error}"
                ) from error
            if isinstance(error, TimeoutError) and connected:
                raise TransferError(f"the Dask scheduler at {address} has no worker") from error
            if isinstance(error, OSError):
                raise TransferError(f"there is no Dask scheduler at {address}: {error}") from error
            raise
        return cls(client, patience)

    @property
    def capacity(self) -> int:
        """How many files may be under way."""
        return max(2 * self._threads, FEWEST_WAITING)

    async def encode(self, task: FileTask) -> FileOutcome:
        """Encode a file on some worker.

        Raises:
            TransferError: the cluster is lost.
        """
        if not self._send_contents:
            outcome = await self._submit(task, None)
            if not outcome.elsewhere:
                return outcome
            self._send_contents = True  # from now on: the workers have no files in common with this machine
        size = task.path.stat().st_size
        async with self._room:
            await self._room.wait_for(lambda: self._sent == 0 or self._sent + size <= CONTENT_BYTES)
            self._sent += size
        try:
            content = await asyncio.to_thread(task.path.read_bytes)
            if await asyncio.to_thread(lambda: hashlib.sha256(content).hexdigest()) != task.digest:
                return FileOutcome(elsewhere=True)
            return await self._submit(task, content)
        finally:
            async with self._room:
                self._sent -= size
                self._room.notify_all()

    async def close(self) -> None:
        """Let go of the scheduler, which then forgets what has not been begun."""
        self._lost.cancel()
        with suppress(asyncio.CancelledError, TransferError):
            await self._lost
        with suppress(OSError, TimeoutError):
            await self._client.close()

    async def _submit(self, task: FileTask, content: bytes | None) -> FileOutcome:
        killed = FileOutcome()
        for _ in range(SUBMISSIONS):
            if self._client.status != "running":
                raise TransferError(LOST)
            future = self._client.submit(encode_file, task, content, pure=False)
            result = asyncio.ensure_future(future.result())
            try:
                await asyncio.wait({result, self._lost}, return_when=asyncio.FIRST_COMPLETED)
                if not result.done():
                    await self._lost  # raises
                outcome: FileOutcome = await result
            except KilledWorker as error:
                killed = FileOutcome(error=f"the workers died that encoded it: {error}")
            except TaskCancelledError as error:
                raise TransferError(LOST) from error
            else:
                return outcome
            finally:
                result.cancel()
                future.release()
        return killed

    async def _watch(self) -> None:
        """Count the cluster's threads; ends with an error once it is lost."""
        loop = asyncio.get_running_loop()
        seen = loop.time()
        while self._client.status != "closed":  # it tries to connect again for a while
            try:
                threads = sum((await self._client.nthreads()).values())
            except OSError:
                threads = 0
            if threads:
                self._threads, seen = threads, loop.time()
            elif loop.time() - seen > self._patience:
                raise TransferError(f"the Dask cluster has had no worker for {self._patience:g} s; run it again")
            await asyncio.sleep(WATCH_SECONDS)
        raise TransferError(LOST)
