import httpx
from fastapi import FastAPI

from meshtide_server.problems import handle_problems


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
