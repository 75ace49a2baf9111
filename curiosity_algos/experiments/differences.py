"""What tells the descriptions of two runs apart, in words."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

MAY_DIFFER = {"device", "n_threads", "tensorboard_log", "verbose"}
"""Settings that results do not depend on."""
_TOLD_APART = (
    *("algorithm", "env", "env_class", "env_kwargs", "wrappers", "vec_env"),
    *("seed", "settings"),
)


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """What is another in a run's description than here: `settings.sigma is 0.3, not 0.5`.

    All that differ in the first field that does: what follows may differ because that does. Empty
    where both are of one run, wherever and with whatever versions it went on.
    """
    for field in _TOLD_APART:
        one, other = (dict(_values(field, each.get(field))) for each in (there, here))
        if names := _that_differ(one, other):
            return [f"{name} is {_text(name, one)}, not {_text(name, other)}" for name in names]
    return []


def _that_differ(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    names = sorted({*one, *other})
    differ = [n for n in names if not (n in one and n in other and one[n] == other[n])]
    # Of an empty dictionary here and a full one there, what the latter holds says it all.
    return [n for n in differ if not any(name.startswith(f"{n}.") for name in names)]


def _text(name: str, values: Mapping[str, Any]) -> str:
    return json.dumps(values[name]) if name in values else "left out"


def _values(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Each value within `value`, by its path."""
    if not isinstance(value, Mapping) or not value:
        yield name, value
        return
    for key, inner in value.items():
        if name != "settings" or key not in MAY_DIFFER:
            yield from _values(f"{name}.{key}", inner)
