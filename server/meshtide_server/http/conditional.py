"""Answers that a client may hold already: JSON with an entity tag."""

from __future__ import annotations

import hashlib
from http import HTTPStatus
from typing import TYPE_CHECKING

from fastapi import Request, Response

from meshtide_server.http.ranges import plan

if TYPE_CHECKING:
    from collections.abc import Mapping


def conditional_json(request: Request, body: bytes, headers: Mapping[str, str] | None = None) -> Response:
    """JSON with a strong entity tag, or 304 if that is what the client holds."""
    etag = f'"{hashlib.sha256(body).hexdigest()[:32]}"'
    common = {"ETag": etag, "Cache-Control": "no-cache", **(headers or {})}
    held = {"if-none-match": request.headers["if-none-match"]} if "if-none-match" in request.headers else {}
    if plan("GET", held, etag, len(body)).status == HTTPStatus.NOT_MODIFIED:
        return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=common)
    return Response(body, headers=common, media_type="application/json")
