import asyncio
import io
import json
import logging
import re
from collections.abc import Iterator

import pytest

from meshtide_server.operations.logs import JsonFormatter, TextFormatter, accepted_id, bound_id, request_id, set_up_log
from meshtide_server.operations.redaction import RedactionFilter
from meshtide_server.settings import LogFormat


@pytest.fixture
def lines() -> Iterator[tuple[logging.Logger, io.StringIO]]:
    """A logger that writes JSON, and where."""
    output = io.StringIO()
    handler = logging.StreamHandler(output)
    handler.setFormatter(JsonFormatter())
    handler.addFilter(RedactionFilter())
    logger = logging.getLogger("tests of the log")
    logger.propagate = False
    logger.addHandler(handler)
    yield logger, output
    logger.removeHandler(handler)


@pytest.fixture
def root() -> Iterator[logging.Logger]:
    """The root logger, restored afterwards."""
    logger = logging.getLogger()
    handlers, level = list(logger.handlers), logger.level
    yield logger
    logger.handlers[:] = handlers
    logger.setLevel(level)
    for name in ("uvicorn", "uvicorn.error", "websockets", "asyncio"):
        logging.getLogger(name).setLevel(logging.NOTSET)


@pytest.mark.parametrize("chosen", [b"a", b"checkout-17", b"7b2c:1.x_y", b"x" * 128])
def test_a_client_may_choose_an_id(chosen: bytes) -> None:
    assert accepted_id(chosen).encode() == chosen


@pytest.mark.parametrize("chosen", [None, b"", b"x" * 129, b"two\nlines", b'"}', b"-x", b"caf\xe9", b"a b"])
def test_an_id_that_could_spoil_the_log_is_replaced(chosen: bytes | None) -> None:
    made = accepted_id(chosen)
    assert re.fullmatch("[0-9a-f]{16}", made)
    assert made != accepted_id(chosen)


async def test_tasks_begun_in_a_request_carry_its_id() -> None:
    async def seen() -> str | None:
        await asyncio.sleep(0)
        return request_id()

    with bound_id("one"):
        task = asyncio.create_task(seen())
    assert request_id() is None
    assert await task == "one"


def test_each_json_line_stands_by_itself(lines: tuple[logging.Logger, io.StringIO]) -> None:
    logger, output = lines
    with bound_id("abc"):
        logger.warning("two\nlines of %s", "text", extra={"fields": {"bytes": 7, "address": "/x?ticket=s3cr3t"}})
    try:
        raise ValueError("Authorization: Bearer s3cr3t")
    except ValueError:
        logger.exception("it failed")
    assert "s3cr3t" not in output.getvalue()
    first, second = map(json.loads, output.getvalue().splitlines())
    assert (first["level"], first["message"], first["request_id"]) == ("warning", "two\nlines of text", "abc")
    assert first["bytes"] == 7
    assert first["time"].endswith("+00:00")
    assert "request_id" not in second
    assert "ValueError" in second["exception"]


def test_text_names_the_request_behind_the_message() -> None:
    record = logging.LogRecord("x", logging.INFO, "", 0, "small is %s", ("ready",), None)
    assert TextFormatter().format(record).split(" ", 1)[1] == "INFO small is ready"
    with bound_id("abc"):
        assert TextFormatter().format(record).endswith("INFO small is ready (request abc)")


def test_the_log_is_set_up_once_and_hides_secrets_at_every_level(
    root: logging.Logger, capsys: pytest.CaptureFixture[str]
) -> None:
    for _ in range(2):
        set_up_log("debug", "json")
    logging.getLogger("websockets.server").debug("< Authorization: Bearer s3cr3t")
    logging.getLogger("meshtide.server").debug("GET /stream?ticket=s3cr3t")
    (line,) = capsys.readouterr().err.splitlines()
    assert "s3cr3t" not in line
    assert json.loads(line)["logger"] == "meshtide.server"
    assert root.level == logging.DEBUG


HOSTILE = "a\x1b[2J\r\n12:00:00 ERROR all is lost\u202e\x00\udcff"


@pytest.mark.usefixtures("root")
@pytest.mark.parametrize("logger", ["meshtide.server", "meshtide.access", "uvicorn.error", "websockets.server"])
@pytest.mark.parametrize("form", ["text", "json"])
def test_what_others_say_is_one_line_and_steers_no_terminal(
    logger: str, form: LogFormat, capsys: pytest.CaptureFixture[str]
) -> None:
    set_up_log("debug", form)
    logging.getLogger(logger).warning("a client sent %s", HOSTILE)
    try:
        raise ValueError(HOSTILE)
    except ValueError:
        logging.getLogger(logger).exception("fault of %s", HOSTILE)
    written = capsys.readouterr().err
    assert not re.search("[\\x00-\\x09\\x0b-\\x1f\\x7f-\\x9f\\u202e\\ud800-\\udfff]", written)
    lines = written.splitlines()
    assert not [line for line in lines if line.startswith("12:00:00 ERROR")]
    entries = [line for line in lines if not line.startswith("    ")]
    assert len(entries) == 2
    assert "all is lost" in entries[0]
    assert "Traceback" in written
    assert "ValueError" in written


def test_what_a_client_did_is_neither_an_error_nor_a_traceback(capsys: pytest.CaptureFixture[str]) -> None:
    set_up_log("info")
    try:
        try:
            b"\xd3\xff".decode()
        except UnicodeDecodeError:
            logging.getLogger("uvicorn.error").exception("Invalid UTF-8 sequence received from client.")
        try:
            raise KeyError("a fault of ours")
        except KeyError:
            logging.getLogger("uvicorn.error").exception("Exception in ASGI application")
    finally:
        logging.getLogger().handlers.clear()
    client, fault = capsys.readouterr().err.split("\n", 1)
    assert client.endswith("INFO a client broke the protocol: a text frame that is no UTF-8")
    assert "ERROR Exception in ASGI application" in fault
    assert "KeyError" in fault
