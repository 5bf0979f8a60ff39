"""The cache of encoded streams: where it is, what its files are called, and when they are stale.

A file's name holds a key made of the mesh file's content, the encoding options, the stream format's version and the
encoder's own sources: whatever changes, the mesh is encoded anew, and nothing is ever served that is not what this
program would encode. Files are written beside their place and moved there.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import meshtide_codec
from meshtide_codec.effort import Effort
from meshtide_codec.stream.header import FORMAT_VERSION
from meshtide_server.hosting.identifiers import slug
from meshtide_server.hosting.stream import StoppedError

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshtide_server.encoding_options import EncodingOptions

logger = logging.getLogger("meshtide.server")

ADJACENT_NAME = ".meshtide"
"""Name of the cache folder that stands beside the meshes."""
CHUNK = 1 << 20
ABANDONED_SECONDS = 3600.0
"""A partial file of this age belongs to no running encoder."""


@dataclass(frozen=True, slots=True)
class CachePlace:
    """Where the stream of one mesh belongs.

    Args:
        folders: folders to look in and, in this order, to write to.
        prefix: how the names of all streams of this mesh with these options begin.
        key: of the wanted one.
    """

    folders: tuple[Path, ...]
    prefix: str
    key: str

    @property
    def paths(self) -> tuple[Path, ...]:
        """Where the stream may lie, the preferred place first."""
        return tuple(folder / f"{self.prefix}.{self.key}.tide" for folder in self.folders)

    def find(self) -> Path | None:
        """The stream's file, if there is one."""
        return next((path for path in self.paths if path.is_file()), None)

    def prune(self) -> None:
        """Delete this mesh's streams that are not the wanted one, and partial files that nobody writes any more."""
        youngest = time.time() - ABANDONED_SECONDS
        for folder in self.folders:
            try:
                stale = [path for path in folder.glob(f"{self.prefix}.*.tide") if path not in self.paths]
                stale += [path for path in folder.glob(f".{self.prefix}.*.part") if path.stat().st_mtime < youngest]
                for path in stale:
                    path.unlink()
                    logger.debug("deleted %s, which is stale", path)
            except OSError as error:
                logger.debug("stale streams stay in %s: %s", folder, error)


def file_digest(path: Path, stopping: Callable[[], bool] = lambda: False) -> str:
    """SHA-256 of a mesh file, and of the files beside it that it refers to.

    Raises:
        StoppedError: `stopping` said so.
        OSError: it cannot be read.
    """
    digest = hashlib.sha256()
    for part in (path, *_companions(path)):
        with part.open("rb") as file:
            while data := file.read(CHUNK):
                digest.update(data)
                if stopping():
                    raise StoppedError
    return digest.hexdigest()


def _companions(path: Path) -> list[Path]:
    """The buffers of a .gltf file, which holds its geometry in files of their own."""
    if path.suffix.lower() != ".gltf":
        return []
    try:
        names = [buffer["uri"] for buffer in json.loads(path.read_bytes())["buffers"]]
        beside = [path.parent / name for name in names if isinstance(name, str) and not name.startswith("data:")]
        return [candidate for candidate in beside if candidate.is_file()]
    except (ValueError, KeyError, TypeError):
        return []  # reading the mesh will show what is wrong with it


@cache
def codec_digest() -> str:
    """SHA-256 of the codec package: every file of it may change what a mesh is encoded to."""
    digest = hashlib.sha256()
    root = Path(meshtide_codec.__file__).parent
    for path in sorted(path for path in root.rglob("*") if path.is_file() and "__pycache__" not in path.parts):
        digest.update(f"{path.relative_to(root).as_posix()}\0{path.stat().st_size}\0".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def stream_key(content: str, options: EncodingOptions) -> str:
    """The key of the stream of a mesh with the digest `content`, encoded by this program with `options`."""
    parts = {"content": content, "options": options.plain(), "format": FORMAT_VERSION, "codec": codec_digest()}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:32]


def name_prefix(name: str, options: EncodingOptions) -> str:
    """How the names of the streams of the mesh file `name`, encoded with `options`, begin; no other names do.

    >>> from meshtide_server.encoding_options import EncodingOptions
    >>> name_prefix("Bunny (1).obj", EncodingOptions(bits=12))
    'bunny-1-obj-58f290dc-compact-b12'
    """
    effort = "" if options.effort is Effort.DEFAULT else f"-{options.effort}"
    return f"{slug(name, 60)}-{_short_digest(name)}-{options.profile}-b{options.bits}{effort}"


def _short_digest(name: str) -> str:
    return hashlib.sha256(os.fsencode(name)).hexdigest()[:8]


def user_cache_folder() -> Path:
    """The folder where this system's users keep what can be made again."""
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "meshtide" / "streams"


def is_writable(folder: Path) -> str | None:
    """None if files can be made in `folder`, which is made if it is missing; else why not."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder, prefix=".meshtide-"):
            return None
    except OSError as error:
        return error.strerror or str(error)


def cache_folders(directory: Path | None, chosen: Path | None, temporary: Callable[[], Path]) -> tuple[Path, ...]:
    """The folders for the streams of the meshes in `directory` (None: the samples), the first writable one first.

    The others follow because streams may lie in them that can be read.

    Args:
        directory: folder of the meshes.
        chosen: cache folder that the user chose.
        temporary: makes the folder that serves if nothing else does, and lasts as long as the server.
    """
    home = f"{slug(directory.name, 40)}-{_short_digest(str(directory))}" if directory else "samples"
    candidates: list[Path] = []
    if chosen is not None:
        candidates.append(chosen / home)
    elif directory is not None:
        candidates.append(directory / ADJACENT_NAME)
    if chosen is None:
        try:
            candidates.append(user_cache_folder() / home)
        except RuntimeError as error:  # there is no home directory
            logger.debug("no user cache folder: %s", error)
    for position, folder in enumerate(candidates):
        problem = is_writable(folder)
        if problem is None:
            return (folder, *candidates[:position], *candidates[position + 1 :])
        level = logging.INFO if chosen is None else logging.WARNING
        logger.log(level, "no streams can be stored in %s: %s", folder, problem)
    fallback = temporary()
    logger.warning(
        "encoded streams are kept in %s until the server stops, then lost; a writable --cache would keep them", fallback
    )
    return (fallback, *candidates)
