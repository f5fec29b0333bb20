"""Validation of tables from files. Types are strict. The error message is one sentence that names
what is wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_args

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from aosplan.errors import RequestError
from aosplan.units import nearest_hint

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

Finite = Annotated[float, Field(allow_inf_nan=False)]


def _as_tuple(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Pair = Annotated[tuple[Finite, Finite], BeforeValidator(_as_tuple)]
"""Two numbers, which are written as a list in a file."""

Words = Annotated[tuple[str, ...], BeforeValidator(_as_tuple)]
"""Several texts, which are written as a list in a file."""

Pixels = Annotated[int, Field(gt=0, le=10**9)]


class Document(BaseModel):
    """A table in a file; unknown names are errors."""

    model_config = ConfigDict(extra="forbid", strict=True)


class OpenDocument(BaseModel):
    """A table that may contain unknown names, because later versions may add names."""

    model_config = ConfigDict(extra="allow", strict=True)


Checked = TypeVar("Checked", bound=BaseModel)


def checked(model: type[Checked], table: Mapping[str, Any], path: str) -> Checked:
    """Validate a table against a document model.

    Raises
    ------
    RequestError
        If the table does not match the model.  The message names the file and the place in the
        file.  If a name is unknown, the hint gives the most similar known name.
    """
    try:
        return model.model_validate(table)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"] if not _is_branch(part)) or "the file"
        hint = ""
        if first["type"] == "extra_forbidden":
            hint = nearest_hint(str(first["loc"][-1]), _names_at(model, first["loc"]))
            raise RequestError(f"'{path}': unknown name '{place}'", hint) from None
        message = first["msg"][:1].lower() + first["msg"][1:]
        raise RequestError(f"'{path}': {place}: {message}", hint) from None
    except RecursionError:
        raise RequestError(f"'{path}' is nested too deeply to be read") from None


def _names_at(model: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """Names that are allowed at the place of the document where an unknown name was found."""
    for part in place[:-1]:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_documents_in(model.model_fields[part].annotation), model)
    return list(model.model_fields)


def _documents_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _documents_in(inner)


def _is_branch(part: Any) -> bool:
    """Whether a part of an error's location names a member of a union type.  Such a part is not a
    name in the file.
    """
    return isinstance(part, str) and (
        part in {"str", "float", "int"} or part.startswith(("constrained", "tuple", "function"))
    )


class MessageDocument(OpenDocument):
    """A warning."""

    code: str
    message: str
