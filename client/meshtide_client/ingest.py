"""Uploading meshes to a server: several at a time, each one watched until the server has encoded it.

What a server has already, by the name of the file, is left alone unless it is to be replaced; so an upload of many
files that was interrupted goes on when it is repeated. One that fails is told at the end and stops no other.
"""

from __future__ import annotations

import re
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import httpx

from meshtide_client.address import ServerAddress
from meshtide_client.credentials import authorization, find_token
from meshtide_client.listing import list_meshes
from meshtide_client.problem import read_problem
from meshtide_codec.errors import MeshtideError, OptionError, ProtocolError, TransferError
from meshtide_codec.files import is_mesh_path

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from pathlib import Path

POLL_SECONDS = 0.5
CHUNK = 1 << 18
WAITING_SECONDS = 60.0
"""How long a server may ask for patience, all in all, before an upload is given up."""
_JOB = re.compile(r"[A-Za-z0-9-]{1,100}")


@dataclass(frozen=True, slots=True)
class Ingested:
    """What became of one file.

    Args:
        file: itself.
        mesh: id of its mesh, or None if the upload was refused.
        state: "done", "failed" or "kept" for one that the server had already.
        error: why it failed.
    """

    file: Path
    mesh: str | None
    state: str
    error: str | None = None


def mesh_files(paths: Sequence[Path]) -> list[Path]:
    """Mesh files and streams: those that are named, and those in folders that are named, at any depth, sorted.

    Raises:
        OptionError: one of them is not there, or there are no meshes at all.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += sorted(file for file in path.rglob("*") if file.is_file() and _is_hosted(file))
        elif path.is_file():
            found.append(path)
        else:
            raise OptionError(f"there is no file or folder {path}")
    if not found:
        raise OptionError("there are no meshes to upload: no .ply, .obj, .off, .stl, .glb or .tide file")
    return found


def ingest(
    files: Sequence[Path],
    url: str,
    *,
    token: str | None = None,
    parallel: int = 4,
    timeout: float = 30.0,
    replace: bool = False,
    options: dict[str, Any] | None = None,
    progress: Callable[[Ingested], None] = lambda _: None,
) -> list[Ingested]:
    """Upload files to the server at `url` and wait until each is encoded.

    Args:
        files: to be uploaded.
        url: the server's address.
        token: for writing, or None for that of the environment.
        parallel: how many are uploaded at a time.
        timeout: seconds without any news until the connection counts as lost.
        replace: whether to upload what the server has under the same name already.
        options: query parameters of each upload, such as bits, profile, tag and licence.
        progress: is told of each file that is through.

    Raises:
        OptionError, ProtocolError, TransferError: the server cannot be reached, or is none.

    Returns:
        What became of each file, in their order.
    """
    server = ServerAddress.parse(url)
    token = token or find_token()
    there = {row.name for row in list_meshes(url, timeout=timeout, token=token) if row.status != "failed"}
    kept = {file: Ingested(file, None, "kept") for file in files if not replace and file.name in there}
    results: dict[Path, Ingested] = dict(kept)
    for result in kept.values():
        progress(result)
    headers = authorization(token)
    with (
        httpx.Client(timeout=timeout, trust_env=not server.is_loopback, headers=headers) as client,
        ThreadPoolExecutor(parallel, thread_name_prefix="upload") as pool,
    ):
        waiting = [
            pool.submit(_ingest_one, client, server, file, dict(options or {})) for file in files if file not in kept
        ]
        for future in as_completed(waiting):
            result = future.result()
            results[result.file] = result
            progress(result)
    return [results[file] for file in files]


def _ingest_one(client: httpx.Client, server: ServerAddress, file: Path, options: dict[str, Any]) -> Ingested:
    try:
        job = _upload(client, server, file, options)
        while job["state"] not in {"done", "failed"}:
            time.sleep(POLL_SECONDS)
            job = _answer(client.get(f"{server}/jobs/{job['id']}"))
    except httpx.HTTPError as error:
        return Ingested(file, None, "failed", f"the connection was lost: {error}")
    except (MeshtideError, OSError) as error:
        return Ingested(file, None, "failed", str(error))
    return Ingested(file, job["mesh"], job["state"], job.get("error") if job["state"] == "failed" else None)


def _upload(client: httpx.Client, server: ServerAddress, file: Path, options: dict[str, Any]) -> dict[str, Any]:
    """Send the file; one that the server asks to wait with is sent again after a while."""
    end = time.monotonic() + WAITING_SECONDS
    while True:
        response = client.post(server.listing_url, params={"filename": file.name, **options}, content=_pieces(file))
        pause = response.headers.get("Retry-After", "")
        if response.status_code != httpx.codes.TOO_MANY_REQUESTS or time.monotonic() > end or not pause.isdigit():
            return _answer(response)
        time.sleep(min(float(pause), 10.0))


def _answer(response: httpx.Response) -> dict[str, Any]:
    if response.status_code not in {httpx.codes.OK, httpx.codes.ACCEPTED}:
        if (problem := read_problem(response.content)) is not None:
            raise problem
        raise ProtocolError(f"{response.url.path} answered with HTTP status {response.status_code}")
    try:
        job: Any = response.json()
        if not _JOB.fullmatch(job["id"]) or not isinstance(job["state"], str):
            raise ValueError(job["id"])
    except (ValueError, LookupError, TypeError) as error:
        raise ProtocolError(f"{response.url.path} does not describe a job; is this a meshtide server?") from error
    return dict(job)


def _pieces(file: Path) -> Iterator[bytes]:
    try:
        with file.open("rb") as opened:
            while piece := opened.read(CHUNK):
                yield piece
    except OSError as error:
        raise TransferError(f"{file} cannot be read: {error.strerror or error}") from error


def _is_hosted(file: Path) -> bool:
    return file.suffix.lower() == ".tide" or (is_mesh_path(file) and file.suffix.lower() != ".gltf")
