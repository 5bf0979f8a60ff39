"""Settings of the server: defaults, overridden by environment variables MESHTIDE_..., overridden by arguments.

Every field has an environment variable of its name in capitals, such as MESHTIDE_PORT; an empty one counts as unset.
"""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass
from ipaddress import ip_network
from pathlib import Path  # noqa: TC003 - pydantic reads the annotations
from typing import Annotated, Literal, Self

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from meshtide_codec.effort import Effort
from meshtide_codec.errors import OptionError
from meshtide_codec.limits import FileLimits, Limits
from meshtide_codec.quantize import DEFAULT_B, LARGEST_B, SMALLEST_B
from meshtide_codec.stream.messages import LARGEST_MESSAGE
from meshtide_server.encoding_options import EncodingOptions

Profile = Literal["compact", "classic"]
Networks = Annotated[tuple[str, ...], NoDecode]
Tokens = Annotated[tuple[SecretStr, ...], NoDecode]
LogLevel = Literal["debug", "info", "warning", "error"]
LogFormat = Literal["text", "json"]
MOST_PROCESSES = 8
"""Encoder processes that a server starts by default, at most; each may take the memory of a large mesh."""
SMALLEST_RATE = 16 * 1024
"""Bytes a second: the largest message takes 16 s at this rate."""
LONGEST_ADDRESS = 4096
_NAME = re.compile(r"[A-Za-z0-9-]+")
MetricsAccess = Literal["read", "open", "off"]


@dataclass(frozen=True, slots=True)
class Option:
    """How a setting is given to the command `serve`.

    Args:
        help: what the command says of it; the setting's description when left out.
        name: of the option, without dashes in front; the setting's name when left out.
        short: one letter for it.
        default: what the command shows as the default; the setting's own when left out.
        argument: whether it is an argument without a name.
        bounded: whether the command itself holds it against the setting's bounds, and shows them.
    """

    help: str = ""
    name: str = ""
    short: str = ""
    default: str = ""
    argument: bool = False
    bounded: bool = False


class Settings(BaseSettings):
    """What a server hosts, where, and how patient it is.

    Raises:
        pydantic.ValidationError: a value outside its range, or nothing to host.

    >>> Settings(samples=True, port=0).port
    0
    """

    model_config = SettingsConfigDict(
        env_prefix="MESHTIDE_",
        env_ignore_empty=True,
        extra="forbid",
        frozen=True,
        hide_input_in_errors=True,  # the input may be a secret
    )

    directory: Annotated[
        Path | None, Option("Folder of .tide files and mesh files (ply, obj, off, stl, glb, gltf).", argument=True)
    ] = Field(default=None, description="Folder of .tide files and mesh files to host.")
    recursive: Annotated[bool, Option("Host subfolders too, under ids with their path.")] = Field(
        default=False,
        description="Host the folder's subfolders too: a mesh there has an id with its path, such as scans/bunny.",
    )
    samples: Annotated[bool, Option("Host the meshes that come with meshtide.")] = Field(
        default=False, description="Host the sample meshes that come with meshtide."
    )
    cache: Annotated[
        Path | None, Option("Folder for encoded streams.", default="beside the meshes, else the user's cache")
    ] = Field(
        default=None,
        description="Folder for encoded streams; beside the meshes if that is writable, else the user's cache folder.",
    )
    data: Annotated[Path | None, Option("Folder where published meshes are kept.")] = Field(
        default=None,
        description="Folder where published meshes are kept: their streams, and a SQLite catalogue, unless store and "
        "database name other places.",
    )
    store: Annotated[
        str | None, Option("Where their streams are kept: a folder, or s3://bucket/folder.", default="in --data")
    ] = Field(default=None, description="Where published streams are kept: a folder, or s3://bucket/folder (extra s3).")
    database: SecretStr | None = Field(
        default=None,
        description="The catalogue of published meshes: sqlite:///file.db, or postgresql://user:password@host/name "
        "(extra postgres). It may hold a password, so it is not an option of the command.",
    )
    database_file: Path | None = Field(
        default=None,
        description="File that holds the address of the database instead, as containers are given secrets.",
    )
    catalogue_seconds: float = Field(
        default=2.0,
        gt=0.0,
        description="How often what is in memory is held against the catalogue, which other servers change too.",
    )
    store_cache_mib: int = Field(
        default=256,
        ge=16,
        le=1 << 20,
        description="MiB of memory for parts of streams from a store that is not a folder; what is used least recently "
        "gives way.",
    )
    bits: Annotated[int, Option(short="-B")] = Field(
        default=DEFAULT_B, ge=SMALLEST_B, le=LARGEST_B, description="Bits per coordinate for meshes encoded here."
    )
    profile: Annotated[Profile, Option("How meshes are encoded here: compact or classic.")] = Field(
        default="compact", description="How meshes are encoded here: compact, or classic, the paper's codec."
    )
    effort: Annotated[Effort, Option("compact: default, or high: smaller, and slower to encode and to decode.")] = (
        Field(
            default=Effort.DEFAULT,
            description="What counts where meshes are encoded in profile compact: default, time, or high, size; those "
            "streams take longer to encode and to decode.",
        )
    )
    rescan_seconds: Annotated[float, Option("How often to look for new and changed files; 0: never.")] = Field(
        default=5.0, ge=0.0, description="How often the folder is looked at again for new and changed files; 0: never."
    )

    host: Annotated[str, Option()] = Field(default="127.0.0.1", description="Address to listen on.")
    port: Annotated[int, Option(bounded=True)] = Field(
        default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one."
    )
    allowed_origins: Annotated[
        tuple[str, ...],
        NoDecode,
        Option("Web origin whose pages may read the meshes; * for all. May be repeated.", name="allow-origin"),
    ] = Field(
        default=(),
        description="Web origins whose pages may read the meshes, such as https://museum.example; * for all. "
        "Pages of the server's own origin and programs that are not browsers always may.",
    )

    allowed_methods: Annotated[
        tuple[str, ...], NoDecode, Option("Method of pages of those origins. May be repeated.", name="allow-method")
    ] = Field(
        default=("GET", "HEAD", "POST"),
        description="Methods of pages of those origins; POST is for tickets. Add PUT and DELETE for pages that write.",
    )
    allowed_headers: Annotated[
        tuple[str, ...],
        NoDecode,
        Option("Header of pages of those origins. May be repeated.", name="allow-header", default="what reading takes"),
    ] = Field(
        default=("Authorization", "Content-Type", "Range", "If-Range", "If-Match", "If-None-Match", "X-Request-ID"),
        description="Headers that pages of those origins may send.",
    )

    # Secrets come from the environment or a file, never from the command line, which everybody on the machine can read.
    write_tokens: Tokens = Field(default=(), description="Tokens of which writing takes one; none: nobody writes.")
    write_tokens_file: Path | None = Field(default=None, description="File with more write tokens, one a line.")
    read_tokens: Tokens = Field(default=(), description="Tokens of which reading takes one; none: everybody reads.")
    read_tokens_file: Path | None = Field(default=None, description="File with more read tokens, one a line.")
    ticket_seconds: Annotated[float, Option("Seconds for which a ticket opens a websocket.")] = Field(
        default=30.0, gt=0.0, le=3600.0, description="Seconds for which a ticket opens a websocket, once."
    )

    connections_per_client: Annotated[int, Option("Connections of one address at a time; 0: no limit.")] = Field(
        default=256,
        ge=0,
        description="Connections of one address at a time; 0: no limit. Addresses of this machine "
        "are not limited, see unlimited_clients; behind a proxy, trusted_proxies has to name it.",
    )
    bytes_per_second: Annotated[int, Option("Bytes a second sent to one address; 0: no limit.")] = Field(
        default=0, ge=0, description="Bytes a second sent to one address over all its connections; 0: no limit."
    )
    writes_per_minute: Annotated[int, Option("Requests of one address that write; 0: no limit.")] = Field(
        default=600, ge=0, description="Requests of one address that write, such as uploads, in a minute; 0: no limit."
    )
    unlimited_clients: Annotated[
        Networks,
        Option("Network that these limits spare. May be repeated.", name="unlimited-client", default="this machine"),
    ] = Field(default=("127.0.0.0/8", "::1/128"), description="Networks to whose addresses these limits do not apply.")
    trusted_proxies: Annotated[
        Networks, Option("Network of proxies whose X-Forwarded-For is believed. May be repeated.", name="trusted-proxy")
    ] = Field(
        default=(), description="Networks of reverse proxies whose X-Forwarded-For and X-Forwarded-Proto are believed."
    )

    max_upload: int = Field(default=1 << 30, ge=1, description="Bytes of an uploaded file at most.")
    upload_stall_timeout: float = Field(
        default=30.0, gt=0.0, description="Seconds that the next bytes of an upload may be waited for."
    )
    max_vertices: int = Field(default=1 << 26, ge=1, description="Vertices of an uploaded mesh at most.")
    max_faces: int = Field(default=1 << 27, ge=1, description="Faces of an uploaded mesh at most.")
    max_decode_memory: int = Field(
        default=1 << 34, ge=1, description="Bytes of memory, by estimate, that decoding an uploaded mesh may take."
    )
    job_processes: int = Field(
        default=0,
        ge=0,
        le=256,
        description="Uploads that are encoded at a time, each in a process of its own; 0: as many as there are "
        f"processors, {MOST_PROCESSES} at most.",
    )
    job_seconds: float = Field(default=3600.0, gt=0.0, description="Seconds that encoding an upload may take.")
    job_processor_seconds: int = Field(
        default=7200, ge=0, description="Seconds of processor time that encoding an upload may take; 0: no limit."
    )
    job_lost_seconds: float = Field(
        default=20.0, ge=1.0, description="Seconds after which a job is tried again whose server is not heard of."
    )
    job_memory: int = Field(
        default=8 << 30, ge=0, description="Bytes of data that encoding an upload may have in memory; 0: no limit."
    )

    hello_timeout: Annotated[float, Option()] = Field(
        default=10.0, gt=0.0, description="Seconds a client has to ask for something."
    )
    stall_timeout: Annotated[float, Option("Seconds a stream may stand still.")] = Field(
        default=300.0, gt=0.0, description="Seconds a stream may stand still, for want of credit or of a reader."
    )
    drain_timeout: Annotated[float, Option("Seconds that running streams have to end in on SIGTERM.")] = Field(
        default=5.0, ge=0.0, description="Seconds that running streams and requests have to end in when it is to stop."
    )
    shutdown_timeout: int = Field(
        default=3, ge=1, description="Seconds that connections have after that, once they were asked to end."
    )
    max_message: int = Field(
        default=LARGEST_MESSAGE, ge=1024, le=LARGEST_MESSAGE, description="Largest frame a client may send, in bytes."
    )
    max_request_line: int = Field(
        default=1 << 16, ge=1024, le=1 << 20, description="Bytes of a request's first line, which holds its address."
    )
    max_head: int = Field(
        default=1 << 17, ge=2048, le=1 << 22, description="Bytes of a request's first line and headers together."
    )
    max_headers: int = Field(default=100, ge=10, le=10_000, description="Headers of a request.")
    frames_per_second: int = Field(
        default=1000, ge=10, description="Frames of one websocket that are worked off in a second; more wait."
    )
    control_frames_per_second: int = Field(
        default=20, ge=1, description="Pings and pongs of one websocket in a second; more end it."
    )
    log_level: Annotated[LogLevel, Option("debug, info, warning or error.")] = Field(
        default="info", description="How much is logged: debug, info, warning or error."
    )
    log_format: Annotated[LogFormat, Option("text or json.")] = Field(
        default="text", description="How: text for people, or json, one object a line, for programs."
    )
    access_log: Annotated[bool, Option("Log every request.")] = Field(
        default=False, description="Log every request at level info, not only at debug."
    )
    metrics: Annotated[MetricsAccess, Option("Who may read /metrics: read, open or off.")] = Field(
        default="read",
        description="Who may read /metrics: read, whoever may read the meshes; open, everybody; off, nobody.",
    )

    @field_validator(
        "allowed_origins", "allowed_methods", "allowed_headers", "unlimited_clients", "trusted_proxies", mode="before"
    )
    @classmethod
    def _split(cls, value: object) -> object:
        """A comma-separated list, as it is in an environment variable, becomes a tuple."""
        if isinstance(value, str):
            return tuple(part.strip() for part in value.split(",") if part.strip())
        return value

    @field_validator("allowed_methods", "allowed_headers")
    @classmethod
    def _check_names(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for name in value:
            if not _NAME.fullmatch(name):
                raise ValueError(f"{name!r} is not a name of a method or header")
        return value

    @field_validator("unlimited_clients", "trusted_proxies")
    @classmethod
    def _check_networks(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(str(ip_network(text)) for text in value)

    @field_validator("bytes_per_second")
    @classmethod
    def _check_rate(cls, value: int) -> int:
        if 0 < value < SMALLEST_RATE:
            raise ValueError(f"at less than {SMALLEST_RATE} bytes a second, one message takes too long")
        return value

    @field_validator("write_tokens", "read_tokens", mode="before")
    @classmethod
    def _split_tokens(cls, value: object) -> object:
        """Tokens separated by commas or white space."""
        return tuple(value.replace(",", " ").split()) if isinstance(value, str) else value

    @field_validator("directory")
    @classmethod
    def _check_directory(cls, value: Path | None) -> Path | None:
        if value is None:
            return None
        if value.is_file():
            raise ValueError(f"{value} is a file; give the folder that holds it")
        if not value.is_dir():
            raise ValueError(f"there is no folder {value}")
        try:
            next(value.iterdir(), None)
        except OSError as error:
            raise ValueError(f"{value} cannot be read: {error.strerror or error}") from error
        return value.resolve()

    @model_validator(mode="after")
    def _check_anything_to_host(self) -> Self:
        if self.database is not None and self.database_file is not None:
            raise ValueError("database and database_file are the same thing; give one of them")
        has_database = self.database is not None or self.database_file is not None
        if self.data is None and (self.store is None) != (not has_database):
            raise ValueError("store and database belong together: give both, or --data for a folder that holds them")
        if self.directory is None and not self.samples and not self.keeps_meshes:
            raise ValueError(
                "nothing to host: give a DIRECTORY of meshes, --samples for the meshes that come along, "
                "or --data for a folder of published ones"
            )
        return self

    @model_validator(mode="after")
    def _check_effort(self) -> Self:
        try:
            _ = self.encoding
        except OptionError as error:
            raise ValueError(str(error)) from error
        return self

    @property
    def encoding(self) -> EncodingOptions:
        """How meshes are encoded of which nothing else is said."""
        return EncodingOptions(self.bits, self.profile, self.effort)

    @property
    def stream_limits(self) -> Limits:
        """What a stream may hold that others have encoded."""
        return Limits(vertices=self.max_vertices, faces=self.max_faces, memory=self.max_decode_memory)

    @property
    def encoder_processes(self) -> int:
        """How many uploads are encoded at a time."""
        return self.job_processes or min(_processors(), MOST_PROCESSES)

    @property
    def file_limits(self) -> FileLimits:
        """What a mesh file may claim that a stranger sent; an archive may hold as much as a file that is none."""
        return FileLimits(
            vertices=self.max_vertices,
            faces=self.max_faces,
            file_bytes=self.max_upload,
            remedy="this server's MESHTIDE_MAX_{setting}",
        )

    @property
    def keeps_meshes(self) -> bool:
        """Whether there is a place to keep meshes that are published here."""
        return self.data is not None or self.store is not None

    @property
    def store_url(self) -> str:
        """Where published streams are kept."""
        return self.store if self.store is not None else str(self._data_folder / "store")

    @property
    def database_url(self) -> str:
        """Where the catalogue is; it may hold a password."""
        if self.database is not None:
            return self.database.get_secret_value()
        if self.database_file is not None:
            return _first_line(self.database_file)
        return f"sqlite:///{self._data_folder / 'catalogue.db'}"

    @property
    def _data_folder(self) -> Path:
        if self.data is None:
            raise ValueError("there is no place to keep meshes; set data, or store and database")
        return self.data.resolve()


def _first_line(path: Path) -> str:
    try:
        with path.open(encoding="utf-8") as file:
            line = file.readline(LONGEST_ADDRESS).strip()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not text"
        raise OptionError(f"the address of the database in {path} cannot be read: {reason}") from error
    if not line:
        raise OptionError(f"{path} should hold the address of the database, postgresql://...; its first line is empty")
    return line


def _processors() -> int:
    """Processors that this process may use, which may be fewer than the machine has."""
    if sys.platform == "linux":
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
