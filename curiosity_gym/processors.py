"""The number of processors there are to use."""

from __future__ import annotations

import math
import os
from contextlib import suppress
from pathlib import Path

CONTROL_GROUP = Path("/sys/fs/cgroup")  # where Linux tells a container its limits
QUOTAS = (("cpu.max",), ("cpu/cpu.cfs_quota_us", "cpu/cpu.cfs_period_us"))
"""Its files, of both versions, with the time of processors in a period, and the period (us)."""


def available_cpus() -> int:
    """Number of processors that this process may run on, and that its container has time for."""
    n = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return math.ceil(min(n, _quota()))


def _quota() -> float:
    """Processors that a container has time for, above 0; infinity where nothing limits it."""
    for names in QUOTAS:
        with suppress(OSError, ValueError):  # the other version's, or "max"
            texts = [(CONTROL_GROUP / name).read_text() for name in names]
            time, period = map(int, " ".join(texts).split())
            if time > 0:  # -1: no limit
                return time / period
    return math.inf
