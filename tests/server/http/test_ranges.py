from http import HTTPStatus

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshtide_server.http.ranges import RangeAnswer, plan

TAG = '"tag"'
SIZE = 1000
WHOLE = RangeAnswer(HTTPStatus.OK, 0, SIZE)
UNSATISFIABLE = RangeAnswer(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, 0, 0)


def part(start: int, end: int) -> RangeAnswer:
    return RangeAnswer(HTTPStatus.PARTIAL_CONTENT, start, end)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("bytes=0-0", part(0, 1)),
        ("bytes=0-", part(0, SIZE)),
        ("bytes=0-999", part(0, SIZE)),
        ("bytes=0-5000", part(0, SIZE)),
        ("bytes=999-", part(999, SIZE)),
        ("bytes=500-500", part(500, 501)),
        ("bytes=000000000000000000000005-6", part(5, 7)),
        ("BYTES=1-2", part(1, 3)),
        ("bytes= 1-2 ", part(1, 3)),
        ("bytes=-1", part(999, SIZE)),
        ("bytes=-1000", part(0, SIZE)),
        ("bytes=-99999", part(0, SIZE)),
        ("bytes=0-" + "9" * 4000, part(0, SIZE)),
        ("bytes=-" + "9" * 4000, part(0, SIZE)),
        ("bytes=1000-", UNSATISFIABLE),
        ("bytes=1000-2000", UNSATISFIABLE),
        ("bytes=" + "9" * 4000 + "-", UNSATISFIABLE),
        ("bytes=-0", UNSATISFIABLE),
        ("bytes=5-2", WHOLE),
        ("bytes=0-1,5-6", WHOLE),
        ("bytes=", WHOLE),
        ("bytes=-", WHOLE),
        ("bytes=a-b", WHOLE),
        ("bytes=1-2-3", WHOLE),
        ("bytes=+1-2", WHOLE),
        ("bytes=\u0661-\u0662", WHOLE),
        ("items=0-1", WHOLE),
        ("", WHOLE),
    ],
)
def test_one_range(text: str, expected: RangeAnswer) -> None:
    assert plan("GET", {"range": text}, TAG, SIZE) == expected


@given(st.text(alphabet="bytes=-,0123456789 ", max_size=40))
def test_any_text_gives_a_plan_inside_the_file(text: str) -> None:
    made = plan("GET", {"range": text}, TAG, SIZE)
    assert made.status in (200, 206, 416)
    assert 0 <= made.start <= made.end <= SIZE
    assert (made.end > made.start) == (made.status != 416)


def test_head_knows_no_ranges() -> None:
    assert plan("HEAD", {"range": "bytes=0-1"}, TAG, SIZE) == WHOLE


@pytest.mark.parametrize(
    ("tags", "matches"),
    [
        (TAG, True),
        ("*", True),
        ('W/"tag"', True),
        ('"a", "tag"', True),
        ('"a","b"', False),
        ("tag", False),
        ('"a, tag"', False),
        ("", False),
    ],
)
def test_if_none_match_is_weak_and_comes_before_ranges(tags: str, matches: bool) -> None:
    made = plan("GET", {"if-none-match": tags, "range": "bytes=0-1"}, TAG, SIZE)
    assert made.status == (304 if matches else 206)


@pytest.mark.parametrize(
    ("tags", "matches"), [(TAG, True), ("*", True), ('W/"tag"', False), ('"a", "tag"', True), ('"a"', False)]
)
def test_if_match_is_strong(tags: str, matches: bool) -> None:
    assert plan("GET", {"if-match": tags}, TAG, SIZE).status == (200 if matches else 412)


@pytest.mark.parametrize(
    ("condition", "matches"),
    [(TAG, True), ('W/"tag"', False), ('"other"', False), ("Wed, 21 Oct 2015 07:28:00 GMT", False)],
)
def test_if_range_sends_the_whole_of_a_changed_file(condition: str, matches: bool) -> None:
    made = plan("GET", {"if-range": condition, "range": "bytes=5-9"}, TAG, SIZE)
    assert made == (part(5, 10) if matches else WHOLE)
