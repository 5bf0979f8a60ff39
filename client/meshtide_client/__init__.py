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
    from meshtide_client.address import MeshAddress, ServerAddress
    from meshtide_client.curation.requests import change_mesh, delete_mesh, list_tags
    from meshtide_client.fetching import FetchResult, fetch
    from meshtide_client.listing import HostedMesh, list_meshes
    from meshtide_client.mesh_search import MeshSearch
    from meshtide_client.streaming import LevelFigures, ReceivedLevel, stream
    from meshtide_client.transport import Link
    from meshtide_codec.stream.session import Until

__all__ = [
    "FetchResult",
    "HostedMesh",
    "LevelFigures",
    "Link",
    "MeshAddress",
    "MeshSearch",
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
    "FetchResult": "meshtide_client.fetching",
    "HostedMesh": "meshtide_client.listing",
    "LevelFigures": "meshtide_client.streaming",
    "Link": "meshtide_client.transport",
    "MeshAddress": "meshtide_client.address",
    "MeshSearch": "meshtide_client.mesh_search",
    "ReceivedLevel": "meshtide_client.streaming",
    "ServerAddress": "meshtide_client.address",
    "Until": "meshtide_codec.stream.session",
    "change_mesh": "meshtide_client.curation.requests",
    "delete_mesh": "meshtide_client.curation.requests",
    "fetch": "meshtide_client.fetching",
    "list_meshes": "meshtide_client.listing",
    "list_tags": "meshtide_client.curation.requests",
    "stream": "meshtide_client.streaming",
}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
