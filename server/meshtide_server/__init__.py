"""meshtide's server: hosts a folder of meshes, over HTTP as files and over websockets level by level.

Where a mesh is, in the words of all its rooms:

- store: where bytes lie under keys, whatever they mean: those of published streams and of uploaded files
- catalogue: the records of published meshes, streams and uploads, in a database; it holds no streams
- published: of a mesh that is in the catalogue, with its stream in the store
- folder: files of one machine that are hosted as they are found, with those that are encoded here, and samples
- shelf: one of these two kinds of meshes; library: both shelves as one
- hosted: in the library of this server, whether ready, being encoded or failed
- cache: copies that may go at any time: encoded streams of the folder on the disk, blocks of the store in memory

>>> from meshtide_server import Settings, create_app
>>> app = create_app(Settings(samples=True))
>>> app.title
'meshtide'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_server.app import create_app
    from meshtide_server.settings import Settings

_HOMES = {"Settings": "settings", "create_app": "app"}

__all__ = ["Settings", "create_app"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
