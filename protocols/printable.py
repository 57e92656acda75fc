"""Text of others: a terminal shows it and does not obey. Names and files may hold anything."""

from typing import Annotated

from pydantic import AfterValidator


def printable(text: str) -> str:
    """``text`` with what cannot be printed, such as escape sequences and line ends, spelled out."""
    return (
        text
        if text.isprintable()
        else "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
    )


Printable = Annotated[str, AfterValidator(printable)]
