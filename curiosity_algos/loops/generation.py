"""A generation as Stable-Baselines3's callbacks see it."""

from __future__ import annotations

from typing import Any

import numpy as np

from curiosity_algos.evaluation.rollouts import Rollouts


def as_step(rollouts: Rollouts, seconds: float) -> dict[str, Any]:
    """The last step of P episodes, as if each individual had an environment of its own.

    Args:
        rollouts: The generation's.
        seconds: Time since training began, as a Monitor notes it of an episode.

    Returns:
        `rewards`: (P,), the returns; `dones`: (P,), all True; `infos`: of each individual what a
        Monitor says of its episode, `is_success`, `terminal_observation`, and `behavior` where the
        environment has one; `rollouts` itself.
    """
    return {
        "rollouts": rollouts,
        "rewards": rollouts.returns,
        "dones": np.ones(len(rollouts), dtype=bool),
        "infos": [_info(rollouts, i, seconds) for i in range(len(rollouts))],
    }


def _info(rollouts: Rollouts, i: int, seconds: float) -> dict[str, Any]:
    info: dict[str, Any] = {
        "episode": {
            "r": round(float(rollouts.returns[i]), 6),
            "l": int(rollouts.lengths[i]),
            "t": round(seconds, 6),
        },
        "is_success": bool(rollouts.success[i]),
        "terminal_observation": rollouts.final_observations[i],
    }
    if rollouts.behaviors.shape[1]:
        info["behavior"] = rollouts.behaviors[i]
    return info
