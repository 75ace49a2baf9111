"""Keywords of algorithms whose constructors pass keywords on to those of their bases."""

from __future__ import annotations

import inspect

_PASSED_ON = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)


def whole_signature(cls: type, base: type) -> inspect.Signature:
    """Parameters of a constructor, and of those up to `base` that it passes keywords on to."""
    parameters: dict[str, inspect.Parameter] = {}
    for ancestor in cls.__mro__[: cls.__mro__.index(base)]:
        if "__init__" not in vars(ancestor):
            continue
        _, *own = inspect.signature(vars(ancestor)["__init__"]).parameters.values()
        public = [p for p in own if p.kind not in _PASSED_ON and p.name[0] != "_"]
        if parameters:  # the constructors before pass keywords on, and nothing else
            public = [p.replace(kind=p.KEYWORD_ONLY) for p in public]
        parameters |= {p.name: p for p in public if p.name not in parameters}
        if not any(p.kind is p.VAR_KEYWORD for p in own):
            break
    return inspect.Signature(sorted(parameters.values(), key=lambda p: p.kind))


def name_in_presets(cls: type) -> str:
    """The name of a class, or of the algorithm of this package that it extends."""
    ours = "curiosity_algos.algorithms."
    return next((c for c in cls.__mro__ if c.__module__.startswith(ours)), cls).__name__
