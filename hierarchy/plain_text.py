"""Words out of a file, such as names, made fit for one line of a terminal."""

from __future__ import annotations

# What a name may take of a line.
LONGEST = 200


def plain_line(text: str, longest: int = LONGEST) -> str:
    """Return `text` in one line of at most `longest` characters, with "?" for what is not printable.

    Line ends and runs of blanks become one blank. Not printable are control characters (a terminal would obey them),
    marks that turn the direction of writing, and bytes of a file's name that are no text.
    """
    # Ten times as many characters are enough, however many blanks there are between them.
    line = " ".join(text[: 10 * longest].split())
    line = "".join(character if character.isprintable() else "?" for character in line)
    return line if len(line) <= longest else f"{line[: longest - 3]}..."
