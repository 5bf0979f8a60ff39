"""Which methods an address knows: HEAD wherever GET is, OPTIONS that lists them, as a refusal (405) does.

Several routes may share an address, one a method; a framework that refuses a method knows only one of
them.
"""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING

from fastapi.routing import APIRoute
from starlette.responses import Response
from starlette.routing import Route

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from fastapi import APIRouter
    from starlette.routing import BaseRoute
    from starlette.types import ASGIApp, Receive, Scope, Send

WHOLE_SERVER = "*"
"""What OPTIONS asks about when it is not about one address (RFC 9110, section 9.3.7)."""


def add_heads(router: APIRouter) -> APIRouter:
    """Have `router` answer HEAD like GET wherever it does not yet; the server below leaves the body out."""
    known = {route.path for route in _routes(router.routes) if "HEAD" in _methods(route)}
    for route in list(router.routes):
        if isinstance(route, APIRoute) and "GET" in _methods(route) and route.path not in known:
            router.add_api_route(
                route.path.removeprefix(router.prefix),
                route.endpoint,
                methods=["HEAD"],
                include_in_schema=False,
                response_class=route.response_class,
                response_model=route.response_model,
                dependencies=route.dependencies[len(router.dependencies) :],
            )
    return router


def allowed_methods(routes: Iterable[BaseRoute], path: str) -> list[str]:
    """The methods that `path` knows, in alphabetical order; none if there is nothing at it; "*" is the whole server."""
    asked = [route for route in _routes(routes) if path == WHOLE_SERVER or route.path_regex.match(path)]
    found = {method for route in asked for method in _methods(route)}
    return sorted(found | {"OPTIONS"}) if found else []


class Methods:
    """The layer that answers OPTIONS; wraps an application.

    Args:
        app: the application inside.
        routes: all of its routes.
    """

    def __init__(self, app: ASGIApp, routes: Sequence[BaseRoute]) -> None:
        self._app = app
        self._routes = routes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] == "http" and scope["method"] == "OPTIONS":
            methods = allowed_methods(self._routes, scope["path"])
            if methods:
                answer = Response(status_code=HTTPStatus.NO_CONTENT, headers={"Allow": ", ".join(methods)})
                await answer(scope, receive, send)
                return
        await self._app(scope, receive, send)


def _routes(routes: Iterable[BaseRoute]) -> list[Route]:
    return [route for route in routes if isinstance(route, Route)]


def _methods(route: Route) -> set[str]:
    return set(route.methods or ())
