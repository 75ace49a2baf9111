"""Controls and places for pictures, as HTML: native elements, each with a name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape


def select(kind: str, name: str, options: Mapping[str, str]) -> str:
    """A choice among values, each with its text.

    Args:
        kind: The class that scripts find it by.
        name: What it is called, shown before it.
        options: Text of each value.
    """
    values = "".join(
        f'<option value="{escape(value)}">{escape(text)}</option>'
        for value, text in options.items()
    )
    return f'<label>{name} <select class="{kind}">{values}</select></label>'


def player(name: str, n: int) -> str:
    """A slider from 1 to n that stands at its end, with a button that plays."""
    return (
        f'<div class="player" role="group" aria-label="{name}"><button type="button">Play</button>'
        f'<input type="range" min="1" max="{n}" value="{n}" step="1" aria-label="{name}">'
        '<output aria-live="off"></output></div>'
    )


def legend(labels: Iterable[str], colors: Mapping[str, str]) -> str:
    """A button for each label that hides and shows it."""
    buttons = "".join(
        f'<button type="button" aria-pressed="true" data-label="{i}">{swatch(colors[label])}'
        f"{escape(label)}</button>"
        for i, label in enumerate(labels)
    )
    return f'<div class="legend" role="group" aria-label="Algorithms shown">{buttons}</div>'


def swatch(color: str) -> str:
    """A dot of a label's color."""
    return f'<span class="swatch" data-color="{color}"></span>'


def picture(kind: str, caption: str, about: str, /, **data: object) -> str:
    """A figure whose plot a script draws.

    Args:
        kind: Classes that scripts find it by.
        caption: HTML.
        about: What it shows, for those who cannot see it; text.
        **data: What else scripts read of it.
    """
    attributes = "".join(f' data-{name}="{value}"' for name, value in data.items())
    return (
        f'<figure class="{kind}"{attributes}><figcaption>{caption}</figcaption>'
        f'<div class="plot" role="img" aria-label="{escape(about)}"></div></figure>'
    )


def key(title: str, low: str, high: str, marks: str = "") -> str:
    """What the colors of a map stand for."""
    return (
        f'<p class="key"><span><span class="key-title">{title}</span></span><span class="key-low">'
        f'{low}</span><span class="ramp"></span><span class="key-high">{high}</span>{marks}</p>'
    )
