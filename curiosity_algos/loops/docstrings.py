"""Docstrings of classes whose constructors pass keywords on: what parents document is shown too."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Sequence

SECTIONS = ("Args", "Attributes", "Raises")
"""Sections that a class shares with its parents, in their order."""

_ENTRY = re.compile(r"    (\w[\w.]*): ")


def full_docstring(cls: type, names: Sequence[str]) -> str:
    """The docstring of a class, with its parents' entries for what it does not document itself.

    Args:
        cls: The class, documented in Google style.
        names: Arguments of its constructor, in the order in which they are to be documented.
    """
    documented = [each for each in cls.__mro__ if vars(each).get("__doc__")]
    text, own = _split(cls)
    sections = []
    for section in SECTIONS:
        entries = _first_of_each(_split(each)[1].get(section, {}) for each in documented)
        if section == "Args":
            entries = {name: entries[name] for name in names if name in entries}
        if section == "Raises" and section in own:
            entries = own[section]
        if entries:
            sections.append("\n".join([f"{section}:", *entries.values()]))
    return "\n\n".join([text, *sections])


def _first_of_each(found: Iterable[dict[str, str]]) -> dict[str, str]:
    """Entries by name; of those with one name, the first."""
    entries: dict[str, str] = {}
    for each in found:
        entries = {**entries, **{k: v for k, v in each.items() if k not in entries}}
    return entries


def _split(cls: type) -> tuple[str, dict[str, dict[str, str]]]:
    """A docstring's text before its sections, and the entries of each section by their names."""
    blocks = re.split(r"\n+(?=\w+:\n    )", inspect.cleandoc(vars(cls).get("__doc__") or ""))
    own = [block for block in blocks if block.partition(":")[0] in SECTIONS]
    text = "\n\n".join(block for block in blocks if block not in own)
    return text, {block.partition(":")[0]: _entries(block) for block in own}


def _entries(block: str) -> dict[str, str]:
    entries: dict[str, str] = {}
    name = ""
    for line in block.splitlines()[1:]:
        begun = _ENTRY.match(line)
        name = begun[1] if begun else name
        entries[name] = line if begun else f"{entries[name]}\n{line}"
    return entries
