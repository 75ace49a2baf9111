"""Ray, which few have: the extra `ray`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from curiosity_gym.extras import import_extra
from curiosity_gym.processors import available_cpus

ray, exceptions = import_extra("ray", "ray", "ray.exceptions")

RESERVED = ("CPU", "GPU", "memory", "object_store_memory")
"""Resources that Ray itself counts."""


def check_resources(resources: Mapping[str, float] | None) -> dict[str, float]:
    """Resources of a worker by the names that a cluster has given them.

    Raises:
        ValueError: If Ray has another argument for one, or an amount is not above 0.
    """
    checked = dict(resources or {})
    for name, amount in checked.items():
        is_number = isinstance(amount, int | float) and not isinstance(amount, bool)
        if name in RESERVED or not is_number or not amount > 0:
            raise ValueError(
                "`resources` must be amounts above 0 of what the cluster calls by names of its "
                f"own, not {', '.join(RESERVED)}, got {amount!r} of {name!r}."
            )
    return checked


def connect(
    address: str | None, num_cpus: int = 0, resources: dict[str, float] | None = None
) -> None:
    """Join a cluster, unless Ray is connected to one already.

    Args:
        address: "auto" finds the cluster that this machine is part of. None: that of the variable
            `RAY_ADDRESS`, or one is started on this machine.
        num_cpus: Processors that it is said to have, at least as many as there are.
        resources: Other resources that it is said to have, by Ray's names.
    """
    if ray.is_initialized():
        return
    address = address or os.environ.get("RAY_ADDRESS", "local")
    options: dict[str, Any] = {"address": address}
    if address == "local":
        options |= {
            "num_cpus": max(available_cpus(), num_cpus),
            "resources": resources,
            "include_dashboard": False,
        }
    ray.init(**options, logging_level="warning")
