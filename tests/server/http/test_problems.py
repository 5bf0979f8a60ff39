import httpx
import pytest
from fastapi import FastAPI

from meshtide_server.catalogue import DatabaseUnavailableError
from meshtide_server.http.problems import handle_problems
from meshtide_server.store import StoreError


async def test_wrong_parameters_are_a_problem_that_does_not_repeat_them() -> None:
    app = FastAPI()
    handle_problems(app)

    @app.get("/double")
    async def double(number: int) -> int:
        return 2 * number

    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
        assert (await client.get("/double?number=4")).json() == 8
        answer = await client.get("/double?number=secret")
    assert answer.status_code == 422
    assert answer.json()["error"] == "invalid"
    assert answer.json()["message"].startswith("query.number: Input should be a valid integer")
    assert "secret" not in answer.text


@pytest.mark.parametrize(
    ("error", "part"), [(StoreError("secret"), "store"), (DatabaseUnavailableError("secret"), "catalogue")]
)
async def test_a_part_that_does_not_answer_is_to_be_tried_again(error: Exception, part: str) -> None:
    app = FastAPI()
    handle_problems(app)

    @app.get("/ask")
    async def ask() -> None:
        raise error

    async with httpx.AsyncClient(transport=httpx.ASGITransport(app), base_url="http://test") as client:
        answer = await client.get("/ask")
    assert (answer.status_code, answer.json()["error"]) == (503, "not-ready")
    assert answer.headers["Retry-After"] == "1"
    assert part in answer.json()["message"]
    assert "secret" not in answer.text
