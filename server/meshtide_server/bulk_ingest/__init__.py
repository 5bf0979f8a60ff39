"""Bulk ingest: many files into a store and a catalogue, without a server.

Registered as the entry point `store` of the group ``meshtide.ingest``, which is how `meshtide ingest` finds it.

    work = BulkIngest(data=Path("kept"), workers=4)
    work.run(files, tell)
"""

from __future__ import annotations

from meshtide_server.bulk_ingest.bulk_ingest import BulkIngest, KnownMesh

__all__ = ["BulkIngest", "KnownMesh"]
