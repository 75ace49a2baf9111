"""All keywords of a class on its page, with types and defaults: those that it hands on, too.

A docstring says "Further keywords are those of `X`." Here that sentence becomes what `X` documents.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterator
from textwrap import indent
from typing import Any

from sphinx.application import Sphinx

HANDED_ON = re.compile(
    r"(?:Further|All)\s+keywords\s+are\s+those\s+of\s+(?P<who>[^.:]+)(?::(?P<which>[^.]+))?"
    r"\.(?: |(?=\n)|$)"
)
SECTION = re.compile(r"^Args:\n((?:(?: {4}.*)?(?:\n|$))*)", re.M)
ENTRY = re.compile(r"^(\w+): ((?:.*(?:\n {4}.*)*))", re.M)
SB3_ENTRY = re.compile(r"^:param (\w+):", re.M)
DEFAULT = re.compile(r"`(\w+)` \((\S+) by default")
OWN = "Arguments"
TITLES = {
    "CuriousAlgorithm": "Of curiosity",
    "Curiosity": "Of the bonus",
    "MotivatedStrategy": "Of reward and motivation",
    "EvolutionStrategy": "Of every evolution strategy",
    "MAPElites": "Of the grid",
    "QualityDiversity": "Of every algorithm with an archive",
    "EvolutionaryAlgorithm": "Of every population algorithm",
    "NetworkBonus": "Of every bonus",
    "EliteArchive": "Of every archive",
    "TD3": "Of Stable-Baselines3's TD3",
}
"""Of the keywords of a class, on the pages of those that hand keywords on to it."""
SECTIONS = [(title, "params_style") for title in (OWN, *TITLES.values())]
"""For napoleon."""


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the keywords before napoleon, whose priority is 500, reads the docstring."""
    app.setup_extension("sphinx.ext.autodoc")  # whose event it is
    app.connect("autodoc-process-docstring", rewrite, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def rewrite(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Replace the arguments of a class that hands keywords on by all of them, in groups."""
    doc = "\n".join(lines)
    if what != "class" or not HANDED_ON.search(doc):
        return
    written = "".join(f"{title}:\n{entries}\n" for title, entries in groups(thing).items())
    doc = HANDED_ON.sub("", SECTION.sub("", doc))
    first = re.search(r"^(?:Attributes|Raises|Warns):", doc, re.M)
    place = len(doc) if first is None else first.start()
    lines[:] = f"{doc[:place].rstrip()}\n\n{written}\n{doc[place:]}".split("\n")


def groups(cls: type[Any]) -> dict[str, str]:
    """The entries of each group, by its title; a keyword is in the first that documents it.

    What may be given without its name is in the first group, in the order of the signature.
    """
    found: dict[str, tuple[str, str]] = {}  # title and entry, by keyword
    parameters = inspect.signature(cls).parameters
    for source in dict.fromkeys(sources(cls)):
        there = inspect.signature(source).parameters
        for keyword, text in documented(source):
            one = parameters.get(keyword)
            if keyword in found or not (one or is_handed_on(cls, keyword)):
                continue
            is_first = source is cls or (one and one.kind is one.POSITIONAL_OR_KEYWORD)
            title = OWN if is_first else TITLES[source.__name__]
            kind = kind_of(one or there[keyword], default_of(cls, keyword))
            found[keyword] = title, indent(f"{keyword} ({kind}): {text}\n", " " * 4)
    order = [name for name in parameters if name in found]
    order = [*order, *(name for name in found if name not in order)]
    written: dict[str, str] = {}
    for title in dict.fromkeys([OWN, *(title for title, _ in found.values())]):
        written[title] = "".join(found[name][1] for name in order if found[name][0] == title)
    return {title: entries for title, entries in written.items() if entries}


def sources(cls: type[Any]) -> Iterator[type[Any]]:
    """A class, and those that it hands keywords on to."""
    yield cls
    for sentence in HANDED_ON.finditer(inspect.getdoc(cls) or ""):
        for name in re.findall(r"`([A-Z]\w+)`", sentence["who"]):
            yield from sources(getattr(sys.modules[cls.__module__], name))


def is_handed_on(cls: type[Any], keyword: str) -> bool:
    """Whether a class takes a keyword that is not in its signature."""
    if all(one.kind is not one.VAR_KEYWORD for one in inspect.signature(cls).parameters.values()):
        return False
    sentence = HANDED_ON.search(inspect.getdoc(cls) or "")
    assert sentence is not None
    named = f"`{keyword}`"
    return named in sentence["which"] if sentence["which"] else named not in sentence["who"]


def documented(cls: type[Any]) -> list[tuple[str, str]]:
    """The arguments in the docstring of a class, and what it says of them."""
    doc = inspect.getdoc(cls) or ""
    section = SECTION.search(doc)
    if section is None:
        return [(name, "As in Stable-Baselines3.") for name in SB3_ENTRY.findall(doc)]
    return ENTRY.findall(re.sub(r"^ {4}", "", section[1], flags=re.M))


def default_of(cls: type[Any], keyword: str) -> str | None:
    """The default that the sentence of a class says in place of the other class'."""
    return dict(DEFAULT.findall(inspect.getdoc(cls) or "")).get(keyword)


def kind_of(parameter: inspect.Parameter, default: str | None) -> str:
    """The type of an argument, and its default if it has one, as code."""
    kind = inspect.formatannotation(parameter.annotation).strip("'")
    if default is None and parameter.default is not parameter.empty:
        value = parameter.default
        default = f"{value.__module__}.{value.__name__}" if isinstance(value, type) else repr(value)
    return f"``{kind}``" if default is None else f"``{kind}``, default ``{default}``"
