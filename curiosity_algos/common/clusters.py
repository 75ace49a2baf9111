"""Ray, which few have: the extra `ray`."""

from __future__ import annotations

import os
from typing import Any

from curiosity_gym.extras import import_extra
from curiosity_gym.processors import available_cpus

ray, exceptions = import_extra("ray", "ray", "ray.exceptions")


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
