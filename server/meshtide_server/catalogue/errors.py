"""What can go wrong with a catalogue.

::

    MeshtideError
    └── CatalogueError
        ├── DatabaseUnavailableError   the database cannot be reached, or does not answer
        ├── NewerSchemaError           the database was made by a newer program
        ├── MeshExistsError            there is a mesh of that id already
        ├── UnknownMeshError           there is no mesh of that id
        └── UnknownJobError            there is no job of that id
"""

from __future__ import annotations

from meshtide_codec.errors import MeshtideError


class CatalogueError(MeshtideError):
    """The catalogue did not do what it was asked to; nothing was changed."""


class DatabaseUnavailableError(CatalogueError):
    """The database cannot be reached, or does not answer."""


class NewerSchemaError(CatalogueError):
    """The database was made by a newer program than this one."""


class MeshExistsError(CatalogueError):
    """There is a mesh of that id already.

    Args:
        mesh_id: the id.
    """

    def __init__(self, mesh_id: str) -> None:
        self.mesh_id = mesh_id
        super().__init__(f"there is a mesh {mesh_id!r} already; take another id, or replace it")


class UnknownMeshError(CatalogueError):
    """There is no mesh of that id.

    Args:
        mesh_id: the id.
    """

    def __init__(self, mesh_id: str) -> None:
        self.mesh_id = mesh_id
        super().__init__(f"there is no mesh {mesh_id!r} in the catalogue")


class UnknownJobError(CatalogueError):
    """There is no job of that id, or not any more.

    Args:
        job_id: the id.
    """

    def __init__(self, job_id: str) -> None:
        self.job_id = job_id
        super().__init__(f"there is no job {job_id!r}")
