"""Untrusted text: names of folders, policies and vehicles, and error messages that quote them.

A terminal obeys escape sequences and a browser obeys markup, so such text is escaped for both.
"""

import re
import unicodedata

MOST = 300
"""Length of a text that is shown in one line, where no other is given [characters]."""
_MOST_OF_ERROR = 4000
_READ = 8  # characters for each that is shown
_SEQUENCE = re.compile(
    r"(?:\x1b\[|\x9b)[0-?]*[ -/]*[@-~]?"  # ECMA-48 control sequences: colours, movements of the cursor
    r"|(?:\x1b[\]PX^_]|[\x90\x98\x9d-\x9f])[^\x07\x1b\x9c]*(?:\x07|\x1b\\|\x9c)?"  # strings: titles, links
    r"|\x1b[ -/]*[0-~]?"
)
_HIDDEN = frozenset(("Cc", "Cf", "Cs", "Co", "Cn"))  # controls, bidi overrides, halves of pairs, what has no glyph
_LINK = re.compile(r"(?<=:)(?=/)|(?<=www)(?=\.)|(?<=@)", re.IGNORECASE)
_JOINER = "\u2060"
_MARKUP = re.compile(
    r"[^\w ,.-]"
    r"|(?<![^\W_])_|_(?![^\W_])"  # within a word it is none
    r"|^[\W_]|^\d(?=\d*\.)|^[ie](?=mport|xport)"
)


def plain_text(value: str, most: int = MOST) -> str:
    """Return a text as one line without control characters.

    Escape sequences, control characters and characters that turn the direction of writing are taken out, and white
    space of any kind and length is one space.

    Args:
        value: The text.
        most: Length above which the end is left out [characters].
    """
    begin = value[: _READ * most]  # a text of megabytes is not read to its end
    shown = (each for each in _SEQUENCE.sub("", begin) if each.isspace() or unicodedata.category(each) not in _HIDDEN)
    line = " ".join("".join(shown).split())
    return line if len(line) <= most and len(begin) == len(value) else f"{line[: max(0, most - 3)]}..."[:most]


def escaped_markdown(value: object, most: int = MOST) -> str:
    """Return the plain text of a value for Markdown, MDX or HTML, without any markup.

    Characters of markup become character references, which those three read alike. So does a first character with which
    a list begins, or ``import``, with which a program begins in MDX. An invisible joiner breaks addresses, which
    GitHub's Markdown makes links even as references.

    Args:
        value: Value whose text is shown.
        most: Length above which the end is left out [characters].
    """
    line = _LINK.sub(_JOINER, plain_text(str(value), most))
    return _MARKUP.sub(lambda found: f"&#{ord(found[0])};", line)


def error_line(text: str) -> str:
    """Return the last line of a failed command; the text may quote what others wrote."""
    return f"error: {plain_text(' '.join(text.split()), _MOST_OF_ERROR)}"
