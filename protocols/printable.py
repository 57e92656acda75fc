"""Text of others: a terminal shows it and does not obey. Names and files may hold anything."""


def printable(text: str) -> str:
    """``text`` with what cannot be printed, such as escape sequences and line ends, spelled out."""
    return (
        text
        if text.isprintable()
        else "".join(char if char.isprintable() else ascii(char)[1:-1] for char in text)
    )


def one_line(text: str) -> str:
    """``text`` on one line that a terminal can show."""
    return printable(" ".join(text.split()))
