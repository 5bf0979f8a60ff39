from pathlib import Path
from typing import Any

import pytest

from meshtide_server.prepared_answers import SECONDS, PreparedAnswers, plain, prepared_answers
from meshtide_server.settings import Settings

HEADERS = [(b"host", b"localhost")]


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def keep(answers: PreparedAnswers, target: bytes, size: int = 10, *, holds: bool = True) -> None:
    answers.keep(target, [(b"etag", b'"a"')], bytes(size), "/packets/{digest}", lambda: holds)


def test_an_answer_is_given_again_for_a_while() -> None:
    clock = Clock()
    answers = PreparedAnswers(clock=clock)
    keep(answers, b"/a")
    found = answers.find(b"/a", HEADERS)
    assert found is not None
    assert found.head == b'HTTP/1.1 200 OK\r\netag: "a"\r\n'
    assert answers.find(b"/a?x", HEADERS) is None
    clock.now = SECONDS
    assert answers.find(b"/a", HEADERS) is None
    assert len(answers) == 0


def test_an_answer_that_no_longer_holds_is_dropped() -> None:
    answers = PreparedAnswers()
    keep(answers, b"/a", holds=False)
    assert answers.find(b"/a", HEADERS) is None
    assert len(answers) == 0


def test_what_was_not_asked_for_the_longest_gives_way() -> None:
    answers = PreparedAnswers(budget=25)
    for target in (b"/a", b"/b"):
        keep(answers, target)
    assert answers.find(b"/a", HEADERS) is not None
    keep(answers, b"/c")
    assert [answers.find(target, HEADERS) is not None for target in (b"/a", b"/b", b"/c")] == [True, False, True]
    keep(answers, b"/c", 15)
    assert [answers.find(target, HEADERS) is not None for target in (b"/a", b"/c")] == [True, True]
    answers.clear()
    keep(answers, b"/d", 25)
    assert len(answers) == 1


@pytest.mark.parametrize(
    ("name", "value"),
    [
        (b"range", b"bytes=0-"),
        (b"if-range", b'"a"'),
        (b"if-modified-since", b"x"),
        (b"authorization", b"Bearer x"),
        (b"origin", b"https://a.example"),
        (b"connection", b"close"),
        (b"connection", b"Upgrade"),
        (b"content-length", b"0"),
        (b"transfer-encoding", b"chunked"),
    ],
)
def test_decisive_headers(name: bytes, value: bytes) -> None:
    answers = PreparedAnswers()
    keep(answers, b"/a")
    assert answers.find(b"/a", [*HEADERS, (name, value)]) is None
    assert answers.find(b"/a", [*HEADERS, (b"connection", b"Keep-Alive"), (b"user-agent", b"x")]) is not None
    assert not plain([(name, value)])


@pytest.mark.parametrize(
    ("given", "enabled"),
    [
        ({}, True),
        ({"access_log": True}, False),
        ({"log_level": "debug"}, False),
        ({"bytes_per_second": 1 << 20}, False),
        ({"read_tokens": "r3ad-r3ad-r3ad-r3ad"}, False),
        ({"read_tokens_file": Path("tokens")}, False),
    ],
)
def test_where_each_request_has_to_be_looked_at_there_are_none(given: dict[str, Any], enabled: bool) -> None:
    assert prepared_answers(Settings(samples=True, **given)).enabled is enabled
