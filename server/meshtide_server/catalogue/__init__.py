"""The catalogue: which meshes there are, which streams hold them, and the jobs that make those streams.

A SQLite file by default, PostgreSQL for several machines; the same code on both. It holds no streams, only their
descriptions, and imports no other room.

    catalogue = await Catalogue.open("sqlite:///catalogue.db")
    page = await catalogue.meshes.list(MeshQuery(text="bunny", tags=("scan",)))
    job = await catalogue.jobs.claim("worker-1")
"""

from __future__ import annotations

from meshtide_server.catalogue.catalogue import Catalogue
from meshtide_server.catalogue.errors import (
    CatalogueError,
    DatabaseUnavailableError,
    MeshExistsError,
    NewerSchemaError,
    UnknownJobError,
    UnknownMeshError,
)
from meshtide_server.catalogue.rows import (
    Box,
    Job,
    JobState,
    MeshPage,
    MeshRecord,
    PacketLocation,
    Status,
    StreamRecord,
)

__all__ = [
    "Box",
    "Catalogue",
    "CatalogueError",
    "DatabaseUnavailableError",
    "Job",
    "JobState",
    "MeshExistsError",
    "MeshPage",
    "MeshRecord",
    "NewerSchemaError",
    "PacketLocation",
    "Status",
    "StreamRecord",
    "UnknownJobError",
    "UnknownMeshError",
]
