"""What Pydantic finds wrong with a document, as one line for people."""

from typing import Any, get_args

from pydantic import BaseModel, ValidationError

_MOST_FINDINGS, _MOST_CHARACTERS = 5, 60
# What Pydantic calls it when a value has another type -> what the value should have been.
_WORDS = {
    "bool_": "true or false",
    "int_": "a whole number",
    "float_": "a number",
    "string_type": "text",
    "tuple_type": "a list",
    "list_type": "a list",
}


def explain_as(document: type[BaseModel], error: ValidationError) -> str:
    """The findings about a ``document`` as one line: field, what is wrong, what would be right."""
    findings = []
    for item in error.errors(include_url=False):
        place, text, kind = item["loc"], item["msg"].removeprefix("Value error, "), item["type"]
        if kind == "extra_forbidden":
            text = f"unknown field; known here: {', '.join(_known_fields(document, place[:-1]))}"
        elif kind == "missing":
            text = "is missing"
        elif wanted := _wanted(document, place, kind, item.get("ctx", {})):
            text = f"write {wanted}, not {shown(item['input'])}"
        elif not kind.startswith("value_error"):
            text = f"{text[0].lower()}{text[1:]}, not {shown(item['input'])}"
        field = ".".join(_name(part) for part in place)
        findings.append(f"{field}: {text}" if field else text)
    more = len(findings) - _MOST_FINDINGS
    return "; ".join(findings[:_MOST_FINDINGS] + ([f"and {more} more"] if more > 0 else []))


def _wanted(
    document: type[BaseModel], place: tuple[int | str, ...], kind: str, limits: dict[str, Any]
) -> str | None:
    """What a value of another type should have been, in the words of a mission file; None: Pydantic says it well enough."""
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        return f"a mapping of its fields ({', '.join(_known_fields(document, place)) or 'name: value'})"
    if kind == "too_long":
        return f"at most {limits['max_length']} values"
    for begin, words in _WORDS.items():
        if kind.startswith(begin):
            return words
    return None


def _name(part: int | str) -> str:
    text = str(part)
    return text if text.isprintable() and len(text) <= _MOST_CHARACTERS else shown(part)


def shown(value: object) -> str:
    """The value on one line that is not too long."""
    if value is None:
        return "nothing"
    try:
        text = " ".join(repr(list(value) if isinstance(value, tuple) else value).split())
    except Exception:  # thousands of digits; a list in a list in a list; what cannot say what it is
        text = type(value).__name__
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS]}..."


def _known_fields(document: type[BaseModel], place: tuple[int | str, ...]) -> list[str]:
    """The fields of the section at ``place``."""
    section: Any = document
    for part in place:
        if isinstance(part, str):
            section = section.model_fields[part].annotation
            section = next((inner for inner in get_args(section) if hasattr(inner, "model_fields")), section)
    return sorted(getattr(section, "model_fields", ()))
