"""Whether two descriptions are of one run."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

MAY_DIFFER = {"device", "n_threads", "tensorboard_log", "verbose"}
"""Settings that results do not depend on."""
_FIELDS = (
    *("algorithm", "env", "env_class", "env_kwargs", "wrappers", "vec_env", "seed"),
    *("settings", "num_timesteps"),
)


def check_same(folder: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    """Check that the run in a folder is the same as here, wherever it went on.

    Raises:
        ValueError: If not; it names the first field that differs.
    """
    one, other = ({name: described.get(name) for name in _FIELDS} for described in (there, here))
    if found := difference(one, other):
        raise ValueError(f"`folder` must be empty or that of this run: in {folder} {found}.")


def difference(there: Any, here: Any, name: str = "") -> str | None:
    """The first value that differs, such as `settings.sigma is 0.3, not 0.5`, or None."""
    if not (isinstance(there, Mapping) and isinstance(here, Mapping)):
        return None if there == here else f"{name} is {json.dumps(there)}, not {json.dumps(here)}"
    for key in dict.fromkeys([*there, *here]):
        path = f"{name}.{key}" if name else key
        found = key not in MAY_DIFFER and difference(there.get(key), here.get(key), path)
        if found:
            return found
    return None
