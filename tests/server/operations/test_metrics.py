import re

import pytest
from prometheus_client.parser import text_string_to_metric_families

from meshtide_codec.packets import PacketKind
from meshtide_server.operations import metrics
from meshtide_server.operations.metrics import REGISTRY, JobOutcome, StreamOutcome


def value(name: str, **labels: str) -> float:
    return REGISTRY.get_sample_value(name, labels) or 0.0


def test_streams_are_counted_from_start_to_end() -> None:
    running = value("meshtide_streams_running")
    ended = {outcome: value("meshtide_streams_ended_total", outcome=outcome) for outcome in StreamOutcome}
    for outcome in StreamOutcome:
        metrics.stream_started()
        assert value("meshtide_streams_running") == running + 1
        metrics.stream_ended(outcome, 0.2)
        assert value("meshtide_streams_ended_total", outcome=outcome) == ended[outcome] + 1
    assert value("meshtide_streams_running") == running


@pytest.mark.parametrize("kind", [*PacketKind, None])
def test_bytes_are_counted_by_kind(kind: PacketKind | None) -> None:
    label = kind.label if kind is not None else "Header"
    before = value("meshtide_stream_bytes_total", kind=label)
    metrics.stream_sent(kind, 100)
    metrics.stream_sent(kind, 11)
    assert value("meshtide_stream_bytes_total", kind=label) == before + 111


def test_time_to_the_first_packet_falls_into_buckets() -> None:
    before = [value("meshtide_first_packet_seconds_bucket", le=bound) for bound in ("0.01", "0.02", "+Inf")]
    metrics.first_packet_sent(0.015)
    after = [value("meshtide_first_packet_seconds_bucket", le=bound) for bound in ("0.01", "0.02", "+Inf")]
    assert after == [before[0], before[1] + 1, before[2] + 1]


def test_jobs_and_their_queue() -> None:
    metrics.jobs_waiting(3)
    assert value("meshtide_jobs_waiting") == 3
    metrics.jobs_waiting(0)
    running = value("meshtide_jobs_running")
    before = value("meshtide_jobs_ended_total", outcome="retried")
    metrics.job_started()
    metrics.job_ended(JobOutcome.RETRIED, 1.5)
    assert value("meshtide_jobs_ended_total", outcome="retried") == before + 1
    assert value("meshtide_jobs_running") == running


def test_what_clients_invent_makes_no_label() -> None:
    metrics.request_answered("INVENTED", None, 405, 0.1, 9)
    assert value("meshtide_http_requests_total", method="other", route="(none)", status="405") >= 1
    assert b"INVENTED" not in metrics.exposition()[0]


def test_the_exposition_can_be_parsed_and_its_names_are_those_of_this_program() -> None:
    metrics.fault("http")
    body, media_type = metrics.exposition()
    assert media_type.startswith("text/plain")
    families = list(text_string_to_metric_families(body.decode()))
    assert all(re.match("meshtide_|process_|python_", family.name) for family in families)
    assert all(family.documentation for family in families)
