"""Docstrings of classes whose constructors pass keywords on: what parents document is shown too."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence

SECTIONS = ("Args", "Attributes", "Raises")
"""Sections that a class shares with its parents, in their order."""

_ENTRY = re.compile(r"    (\*{0,2}[\w.]+)( \(.*?\))?:")

Entries = dict[str, str]
"""Name: the text of its entry in a section."""


def full_docstring(cls: type, names: Sequence[str]) -> str | None:
    """The docstring of a class, with its parents' entries for what it does not document itself.

    Args:
        cls: The class, documented in Google style; sections that are not are left as they are.
        names: Arguments of its constructor, in the order in which they are to be documented.

    Returns:
        None where nothing is documented, as in an optimized interpreter.
    """
    documented = [_split(each) for each in cls.__mro__ if vars(each).get("__doc__")]
    if not documented:
        return None
    text = documented[0][0]
    args, attributes, raises = (
        [sections.get(section, {}) for _, sections in documented] for section in SECTIONS
    )
    known = _nearest(args)
    found = {
        "Args": [known[name] for name in names if name in known],
        "Attributes": list(_nearest(attributes).values()),
        # Each class raises errors of its own, under the same names.
        "Raises": list(dict.fromkeys(entry for each in raises for entry in each.values())),
    }
    shown = ["\n".join([f"{section}:", *entries]) for section, entries in found.items() if entries]
    return "\n\n".join([text, *shown])


def _nearest(found: list[Entries]) -> Entries:
    """Entries by name; of those with one name, the first."""
    entries: Entries = {}
    for each in reversed(found):
        entries |= each
    return entries


def _split(cls: type) -> tuple[str, dict[str, Entries]]:
    """A docstring's text outside of sections, and the entries of each section."""
    text: list[str] = []
    sections: dict[str, Entries] = {}
    for block in re.split(r"\n\s*\n(?=\S)", inspect.cleandoc(vars(cls)["__doc__"])):
        title, _, body = block.partition(":\n")
        entries = _entries(body) if title in SECTIONS else {}
        if entries:
            sections[title] = entries
        else:
            text.append(block)
    return "\n\n".join(text), sections


def _entries(body: str) -> Entries:
    """The entries of a section; none where it does not begin with one."""
    entries: Entries = {}
    name = None
    for line in body.splitlines():
        begun = _ENTRY.match(line)
        if begun is not None:
            name = begun[1]
            entries[name] = line
        elif name is None:
            return {}
        else:
            entries[name] += f"\n{line}"
    return entries
