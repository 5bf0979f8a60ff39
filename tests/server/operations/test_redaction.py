import io
import logging

import pytest

from meshtide_server.operations.redaction import STRUCK, RedactionFilter, redact

HIDDEN = "s3cr3t-0f-s0me0ne"


@pytest.mark.parametrize(
    "line",
    [
        f"< Authorization: Bearer {HIDDEN}",
        f"{{'authorization': 'Bearer {HIDDEN}', 'host': 'h'}}",
        f"(b'authorization', b'Bearer {HIDDEN}')",
        f"Cookie: session={HIDDEN}; other={HIDDEN}",
        f"sent Bearer {HIDDEN} to somebody",
        f"GET /meshes/vase/stream?ticket={HIDDEN} HTTP/1.1",
        f"GET /meshes/vase/stream?a=b&ticket={HIDDEN}&c=d HTTP/1.1",
        f"cannot connect to postgresql://meshtide:{HIDDEN}@host/catalogue",
    ],
)
def test_secrets_are_struck_out(line: str) -> None:
    redacted = redact(line)
    assert HIDDEN not in redacted
    assert STRUCK in redacted


@pytest.mark.parametrize(
    "line", ["10:00 vase is ready: 3 levels", "GET /meshes?search=ticket HTTP/1.1", "http://localhost:8000/meshes/a@b"]
)
def test_other_lines_stay_as_they_are(line: str) -> None:
    assert redact(line) == line


def test_a_handler_with_the_filter_writes_no_secret() -> None:
    output = io.StringIO()
    handler = logging.StreamHandler(output)
    handler.addFilter(RedactionFilter())
    logger = logging.getLogger("tests of redaction")
    logger.setLevel(logging.INFO)
    logger.propagate = False
    logger.addHandler(handler)
    logger.info("%s - %s", "client", f"/stream?ticket={HIDDEN}")
    try:
        raise ValueError(f"Authorization: Bearer {HIDDEN}")
    except ValueError:
        logger.exception("it failed")
    assert HIDDEN not in output.getvalue()
    assert output.getvalue().count(STRUCK) == 3
    assert "client - /stream" in output.getvalue()
