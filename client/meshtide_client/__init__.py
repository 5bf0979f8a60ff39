"""The meshtide client: fetches meshes from a server and rebuilds them level by level as the bytes arrive.

::

    import meshtide_client

    mesh = meshtide_client.fetch("http://localhost:8000/meshes/stanford-bunny").mesh

    async for level in meshtide_client.stream("http://localhost:8000/meshes/stanford-bunny"):
        show(level.mesh)

Names are imported when they are first used, so that `import meshtide_client` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from meshtide_client.connection.address import MeshAddress, ServerAddress
    from meshtide_client.connection.link import Link
    from meshtide_client.download.fetch import FetchResult, fetch
    from meshtide_client.download.levels import LevelFigures, ReceivedLevel
    from meshtide_client.download.stream import stream
    from meshtide_client.remote.edit import change_mesh, delete_mesh, list_tags
    from meshtide_client.remote.listing import ListedMesh, list_meshes
    from meshtide_codec.stream.mesh_query import MeshQuery
    from meshtide_codec.stream.session import Until

__all__ = [
    "FetchResult",
    "LevelFigures",
    "Link",
    "ListedMesh",
    "MeshAddress",
    "MeshQuery",
    "ReceivedLevel",
    "ServerAddress",
    "Until",
    "change_mesh",
    "delete_mesh",
    "fetch",
    "list_meshes",
    "list_tags",
    "stream",
]

_HOMES = {
    "FetchResult": "meshtide_client.download.fetch",
    "ListedMesh": "meshtide_client.remote.listing",
    "LevelFigures": "meshtide_client.download.levels",
    "Link": "meshtide_client.connection.link",
    "MeshAddress": "meshtide_client.connection.address",
    "MeshQuery": "meshtide_codec.stream.mesh_query",
    "ReceivedLevel": "meshtide_client.download.levels",
    "ServerAddress": "meshtide_client.connection.address",
    "Until": "meshtide_codec.stream.session",
    "change_mesh": "meshtide_client.remote.edit",
    "delete_mesh": "meshtide_client.remote.edit",
    "fetch": "meshtide_client.download.fetch",
    "list_meshes": "meshtide_client.remote.listing",
    "list_tags": "meshtide_client.remote.edit",
    "stream": "meshtide_client.download.stream",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
