"""The query of GET /meshes: a model made of the fields of MeshQuery, which checks what comes and describes what may."""

from __future__ import annotations

from dataclasses import fields
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, Field, create_model, field_validator

from meshtide_codec.stream.mesh_query import ASKED, LONGEST_TEXT, MOST_TAGS, MeshQuery, parse_box
from meshtide_server.catalogue import Status
from meshtide_server.catalogue.meshes import LARGEST_PAGE

if TYPE_CHECKING:
    from meshtide_codec.stream.mesh_query import Asked

_NO_NUL = r"^[^\x00]*$"
"""A character that no text in the catalogue holds, and that PostgreSQL does not take."""
_TEXT: dict[str, Any] = {"max_length": LONGEST_TEXT, "pattern": _NO_NUL}


class _Question(BaseModel):
    """What a question does with its fields."""

    def query(self) -> MeshQuery:
        """The same as the library understands it."""
        values = {name: getattr(self, asked.name or name) for name, asked in ASKED.items()}
        values |= {"tags": tuple(values["tags"]), "box": parse_box(values["box"]) if values["box"] else None}
        return MeshQuery(**values)

    @property
    def page_size(self) -> int:
        """How many meshes at most."""
        return int(self.model_dump(include={"limit"})["limit"])

    @field_validator("box", check_fields=False)
    @classmethod
    def _check_box(cls, value: str | None) -> str | None:
        if value is not None:
            parse_box(value)
        return value

    @field_validator("created_after", "created_before", check_fields=False)
    @classmethod
    def _assume_utc(cls, value: datetime | None) -> datetime | None:
        return value.replace(tzinfo=UTC) if value is not None and value.tzinfo is None else value


def _field(name: str, asked: Asked, default: object) -> tuple[Any, Any]:
    """A field of MeshQuery as pydantic makes it: its kind, and what else is known of it."""
    described: dict[str, Any] = {"description": asked.meaning}
    if asked.example is not None:
        described["examples"] = [asked.example]
    if name == "tags":
        return list[Annotated[str, Field(**_TEXT)]], Field([], max_length=MOST_TAGS, **described)
    if name == "status":
        return Status | None, Field(None, **described)
    if name == "box":
        return str | None, Field(None, **described)
    if name.startswith("created"):
        return datetime | None, Field(None, **described)
    if isinstance(default, str):
        return str, Field(default, **_TEXT, **described)
    return int | None, Field(None, ge=0, le=asked.largest, **described)


def _fields() -> dict[str, Any]:
    """All fields by their names in an address."""
    made = {}
    for each in fields(MeshQuery):
        asked = ASKED[each.name]
        made[asked.name or each.name] = _field(each.name, asked, each.default)
    made["limit"] = int, Field(100, ge=1, le=LARGEST_PAGE, description="How many at most.", examples=[100])
    return made


if TYPE_CHECKING:
    MeshQuestion = _Question
else:
    MeshQuestion = create_model("MeshQuestion", __base__=_Question, __doc__="Which meshes are asked for.", **_fields())
