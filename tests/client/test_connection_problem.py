import pytest

from meshtide_client.connection.problem import LARGEST_PROBLEM, read_problem


def test_a_refusal_keeps_code_and_message() -> None:
    problem = read_problem(b'{"error": "too-many", "message": "come again", "more": 1}')
    assert problem is not None
    assert (problem.code, problem.message) == ("too-many", "come again")


def test_long_texts_are_cut() -> None:
    problem = read_problem(b'{"error": "x", "message": "' + b"y" * 5000 + b'"}')
    assert problem is not None
    assert len(problem.message) == 1000


@pytest.mark.parametrize(
    "body",
    [b"", b"<html>", b"[]", b"3", b"null", b'{"error": "x"}', b'{"message": "x"}', b"[" * 60_000, b"\xff\xfe"],
)
def test_anything_else_is_none(body: bytes) -> None:
    assert read_problem(body) is None


def test_a_huge_body_is_not_read() -> None:
    assert read_problem(b'{"error": "x", "message": "' + b"y" * LARGEST_PROBLEM + b'"}') is None
