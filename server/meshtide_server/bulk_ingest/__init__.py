"""Bulk ingest: many files into a store and a catalogue, without a server.

`bulk_ingest.BulkIngest` is registered as the entry point `store` of the group ``meshtide.ingest``, which is how the
command `meshtide ingest` finds it. Nothing is imported here, for a cluster's worker needs `encode_file` alone. May
import the settings, `encoding/`, `hosting/`, `catalogue/` and `store/`; nothing imports it.
"""
