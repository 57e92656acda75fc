"""Text of others, as it may stand on a terminal: nothing in it does anything there."""

from typing import Annotated

from pydantic import AfterValidator


def printable(text: str) -> str:
    """``text`` with a question mark for whatever cannot be printed: escape sequences, line ends."""
    return text if text.isprintable() else "".join(char if char.isprintable() else "?" for char in text)


Printable = Annotated[str, AfterValidator(printable)]
