"""What the server counts, for Prometheus: metrics, and small functions that the other modules call.

Labels are drawn from closed sets, such as the kinds of packets and the templates of routes: what a client sends, such
as the id of a mesh, never becomes one, for it would let clients fill the memory of the server and of whoever collects.
"""

from __future__ import annotations

from enum import StrEnum
from functools import cache

from prometheus_client import (
    CONTENT_TYPE_LATEST,
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    PlatformCollector,
    ProcessCollector,
    generate_latest,
)

from meshtide_codec.packets import PacketKind

REGISTRY = CollectorRegistry(auto_describe=True)
ProcessCollector(registry=REGISTRY)
PlatformCollector(registry=REGISTRY)

UNMATCHED = "(none)"
"""The route of a request for an address at which there is nothing."""
HEADER_KIND = "Header"
"""The kind of a stream's header, beside the labels of the packets' kinds."""
_METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"})
_FAST_SECONDS = (0.001, 0.0025, 0.005, 0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0)
_LONG_SECONDS = (0.01, 0.05, 0.1, 0.5, 1.0, 5.0, 10.0, 30.0, 60.0, 300.0, 1800.0)


class StreamOutcome(StrEnum):
    """How a stream over a websocket ended."""

    COMPLETE = "complete"
    """All that was asked for was sent."""
    LEFT = "left"
    """The client went away or gave up."""
    REFUSED = "refused"
    """There is no such mesh, it is not ready, or the client may not have it."""
    BREACH = "breach"
    """The client broke the protocol."""
    TIMEOUT = "timeout"
    """The client was too slow, or silent."""
    SHUTDOWN = "shutdown"
    """The server went away."""
    FAULT = "fault"
    """A fault of the server."""


class JobOutcome(StrEnum):
    """How an attempt at a job ended."""

    DONE = "done"
    FAILED = "failed"
    RETRIED = "retried"
    """It failed and will be tried once more."""
    RELEASED = "released"
    """It was handed back, for this server stops."""


class ReadOutcome(StrEnum):
    """How a read from a store that is not a folder ended."""

    DONE = "done"
    FAILED = "failed"
    """The store did not answer, or refused."""
    DAMAGED = "damaged"
    """The store returned something else than what was put there."""


_streams_running = Gauge("meshtide_streams_running", "Streams over websockets that are open.", registry=REGISTRY)
_streams_started = Counter("meshtide_streams_started", "Streams that were begun.", registry=REGISTRY)
_streams_ended = Counter("meshtide_streams_ended", "Streams that ended, by outcome.", ["outcome"], registry=REGISTRY)
_stream_seconds = Histogram(
    "meshtide_stream_seconds",
    "Seconds from a stream's handshake to its end.",
    buckets=_LONG_SECONDS,
    registry=REGISTRY,
)
_stream_bytes = Counter(
    "meshtide_stream_bytes", "Payload sent over websockets, by kind of packet.", ["kind"], registry=REGISTRY
)
_first_packet = Histogram(
    "meshtide_first_packet_seconds",
    "Seconds from a client's hello to the first part of a packet.",
    buckets=_FAST_SECONDS,
    registry=REGISTRY,
)
_jobs_waiting = Gauge("meshtide_jobs_waiting", "Meshes that wait to be encoded.", registry=REGISTRY)
_jobs_running = Gauge("meshtide_jobs_running", "Meshes that this server is encoding.", registry=REGISTRY)
_jobs_ended = Counter("meshtide_jobs_ended", "Attempts to encode a mesh, by outcome.", ["outcome"], registry=REGISTRY)
_job_seconds = Histogram(
    "meshtide_job_seconds", "Seconds that an attempt to encode took.", buckets=_LONG_SECONDS, registry=REGISTRY
)
_requests = Counter(
    "meshtide_http_requests",
    "HTTP requests that were answered, by method, template of the route, and status.",
    ["method", "route", "status"],
    registry=REGISTRY,
)
_request_seconds = Histogram(
    "meshtide_http_request_seconds",
    "Seconds from a request to the last byte of its answer, by template of the route.",
    ["route"],
    buckets=_FAST_SECONDS,
    registry=REGISTRY,
)
_request_bytes = Counter(
    "meshtide_http_body_bytes", "Bytes of bodies sent, by template of the route.", ["route"], registry=REGISTRY
)
_store_cache = Gauge(
    "meshtide_store_cache_bytes", "Parts of streams in memory, from a store that is not a folder.", registry=REGISTRY
)
_store_reads = Counter(
    "meshtide_store_reads", "Reads from a store that is not a folder, by outcome.", ["outcome"], registry=REGISTRY
)
_store_bytes = Counter("meshtide_store_read_bytes", "Bytes read from a store that is not a folder.", registry=REGISTRY)
_faults = Counter("meshtide_errors", "Faults of this server, by part.", ["part"], registry=REGISTRY)
_draining = Gauge("meshtide_draining", "1 while the last streams are waited for before the end.", registry=REGISTRY)

_bytes_by_kind: dict[PacketKind | None, Counter] = {
    **{kind: _stream_bytes.labels(kind.label) for kind in PacketKind},
    None: _stream_bytes.labels(HEADER_KIND),
}
_ended_by_outcome = {outcome: _streams_ended.labels(outcome.value) for outcome in StreamOutcome}
_reads_by_outcome = {outcome: _store_reads.labels(outcome.value) for outcome in ReadOutcome}
_jobs_by_outcome = {outcome: _jobs_ended.labels(outcome.value) for outcome in JobOutcome}


def stream_started() -> None:
    """A client was let in."""
    _streams_started.inc()
    _streams_running.inc()


def stream_ended(outcome: StreamOutcome, seconds: float) -> None:
    """A stream that was started has ended, `seconds` later."""
    _streams_running.dec()
    _ended_by_outcome[outcome].inc()
    _stream_seconds.observe(seconds)


def stream_sent(kind: PacketKind | None, size: int) -> None:
    """`size` bytes of a packet of that kind, or of the header (None), went to a client."""
    _bytes_by_kind[kind].inc(size)


def first_packet_sent(seconds: float) -> None:
    """A client was sent the first part of a packet, `seconds` after its hello."""
    _first_packet.observe(seconds)


def jobs_waiting(count: int) -> None:
    """So many meshes wait to be encoded."""
    _jobs_waiting.set(count)


def job_started() -> None:
    """This server begins to encode a mesh."""
    _jobs_running.inc()


def job_ended(outcome: JobOutcome, seconds: float) -> None:
    """An attempt that was started has ended, `seconds` later."""
    _jobs_running.dec()
    _jobs_by_outcome[outcome].inc()
    _job_seconds.observe(seconds)


def store_cache(size: int) -> None:
    """So many bytes of streams of a store are kept in memory, or being fetched."""
    _store_cache.set(size)


def store_read(outcome: ReadOutcome, size: int) -> None:
    """A store was asked for a part of a stream, and gave `size` bytes."""
    _reads_by_outcome[outcome].inc()
    _store_bytes.inc(size)


def request_answered(method: str, route: str | None, status: int, seconds: float, size: int) -> None:
    """A request was answered.

    Args:
        method: of the request.
        route: template of the route that answered, such as /meshes/{mesh_id}; None if there was none.
        status: of the answer.
        seconds: that it took.
        size: of the body that was sent, in bytes.
    """
    requests, durations, sizes = _request_children(
        method if method in _METHODS else "other", route or UNMATCHED, status
    )
    requests.inc()
    durations.observe(seconds)
    sizes.inc(size)


def fault(part: str) -> None:
    """Something went wrong in the server itself.

    Args:
        part: of the server: http, stream, library, catalogue, store or jobs.
    """
    _faults.labels(part).inc()


def draining(*, now: bool) -> None:
    """The server begins to wait for its last streams, or is done with that."""
    _draining.set(now)


def exposition() -> tuple[bytes, str]:
    """All metrics in Prometheus's text format, and its media type."""
    return generate_latest(REGISTRY), CONTENT_TYPE_LATEST


@cache
def _request_children(method: str, route: str, status: int) -> tuple[Counter, Histogram, Counter]:
    """The metrics of one kind of answer; cached, for finding them costs more than counting."""
    return (
        _requests.labels(method, route, str(status)),
        _request_seconds.labels(route),
        _request_bytes.labels(route),
    )
