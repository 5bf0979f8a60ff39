"""The catalogue's tables, as SQLAlchemy knows them. `migrations` makes them; a test holds the two against each other.

Times are microseconds since 1970 in UTC and lists are rows of their own, so that SQLite and PostgreSQL keep the same.
"""

from __future__ import annotations

from sqlalchemy import BigInteger, Column, Double, ForeignKey, Integer, LargeBinary, MetaData, Table, Text

metadata = MetaData()

stream_table = Table(
    "stream",
    metadata,
    Column("sha256", Text, primary_key=True),
    Column("fingerprint", Text, nullable=False),
    Column("header", LargeBinary, nullable=False),
    Column("size", BigInteger, nullable=False),
)

packet_table = Table(
    "packet",
    metadata,
    Column("stream_sha256", Text, ForeignKey("stream.sha256", ondelete="CASCADE"), primary_key=True),
    Column("position", Integer, primary_key=True),
    Column("sha256", Text, nullable=False),
    Column("start", BigInteger, nullable=False),
    Column("length", BigInteger, nullable=False),
)

BOX_COLUMNS = ("minimum_x", "minimum_y", "minimum_z", "maximum_x", "maximum_y", "maximum_z")

mesh_table = Table(
    "mesh",
    metadata,
    Column("id", Text, primary_key=True),
    Column("name", Text, nullable=False),
    Column("licence", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("reason", Text),
    Column("stream_sha256", Text, ForeignKey("stream.sha256")),
    Column("source_sha256", Text),
    Column("size", BigInteger),
    Column("vertices", BigInteger),
    Column("faces", BigInteger),
    Column("levels", Integer),
    *(Column(name, Double) for name in BOX_COLUMNS),
    Column("search_text", Text, nullable=False),
    Column("created", BigInteger, nullable=False),
    Column("updated", BigInteger, nullable=False),
)

tag_table = Table(
    "mesh_tag",
    metadata,
    Column("mesh_id", Text, ForeignKey("mesh.id", ondelete="CASCADE"), primary_key=True),
    Column("tag", Text, primary_key=True),
)

job_table = Table(
    "job",
    metadata,
    Column("id", Text, primary_key=True),
    Column("mesh_id", Text, ForeignKey("mesh.id", ondelete="CASCADE"), nullable=False),
    Column("source_key", Text, nullable=False),
    Column("options", Text, nullable=False),
    Column("state", Text, nullable=False),
    Column("attempts", Integer, nullable=False),
    Column("owner", Text),
    Column("heartbeat", BigInteger),
    Column("stage", Text, nullable=False),
    Column("progress", Double, nullable=False),
    Column("error", Text),
    Column("created", BigInteger, nullable=False),
    Column("finished", BigInteger),
    Column("description", Text),
    Column("notes", Text),
)

unused_table = Table(  # streams in the store that no mesh needs: not yet, or not any more
    "unused_stream",
    metadata,
    Column("sha256", Text, primary_key=True),
    Column("since", BigInteger, nullable=False),
)

pending_table = Table(  # uploads whose objects are being put, and whose jobs are not queued yet
    "pending_upload",
    metadata,
    Column("id", Text, primary_key=True),
    Column("source_key", Text, nullable=False),
    Column("since", BigInteger, nullable=False),
)

schema_table = Table("schema_version", metadata, Column("version", Integer, primary_key=True))
