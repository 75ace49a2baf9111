"""Episodes of robots for the page that shows them in the browser: `python docs/play_robots.py`.

It plays them anew, which needs MuJoCo, and writes `play/robots.npz`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos.common.arrays import Array, Float64Array
from curiosity_algos.experiments.pretrained import load_pretrained, pretrained_seed
from curiosity_algos.robust.measure import UNSEEN

EPISODES = Path(__file__).parent / "play" / "robots.npz"
ANT, HUMANOID = (f"CuriosityLocomotion-{name}Trap-v0" for name in ("Ant", "Humanoid"))
SHOWN = {
    "Ant, trained by robustify": ("PPO", ANT, 10, 3),
    "Ant, found by CuriosityES": ("CuriosityES", ANT, 6, 6),
    "Humanoid, trained by robustify": ("PPO", HUMANOID, 10, 8),
    "Humanoid, found by CuriosityES": ("CuriosityES", HUMANOID, 6, 9),
}
"""By title the algorithm, the environment, how many starts, and steps from picture to picture."""
UNIT = 1e-3
"""Meters of a whole number: two bytes reach 32 m."""


def record() -> None:
    """Play every episode, and write where the parts of the robots are."""
    arrays: dict[str, Array] = {}
    for title, (algorithm, env_id, n_starts, stride) in SHOWN.items():
        policy, env = load_pretrained(algorithm, env_id), gym.make(env_id)
        model, world = env.unwrapped.task.model, gym.spec(env_id).kwargs["world"]
        own = pretrained_seed(algorithm, env_id)
        seeds = [*([] if own is None else [own]), *range(UNSEEN, UNSEEN + n_starts)]
        episodes = [_play(policy, env, seed, stride) for seed in seeds[:n_starts]]
        pictures, lengths, success = zip(*episodes, strict=True)
        arrays[f"{title}/pictures"] = np.concatenate(pictures)
        arrays[f"{title}/counts"] = np.array([len(taken) for taken in pictures])
        arrays[f"{title}/lengths"], arrays[f"{title}/success"] = map(np.array, (lengths, success))
        arrays[f"{title}/radii"] = model.geom_size[_parts(model), 0]
        arrays[f"{title}/stride"], arrays[f"{title}/world"] = map(np.array, (stride, world))
        env.close()
    np.savez_compressed(EPISODES, **arrays)


def _play(policy: Any, env: Any, seed: int, stride: int) -> tuple[Array, int, bool]:
    """Pictures (n, parts, 6) of an episode, its length, and whether it came to the goal."""
    observation, info = env.reset(seed=seed)
    model, data = env.unwrapped.task.model, mujoco.MjData(env.unwrapped.task.model)
    pictures, t, is_over = [_picture(env, model, data)], 0, False
    while not is_over:
        action, _ = policy.predict(observation, deterministic=True)
        observation, _, terminated, truncated, info = env.step(action)
        t, is_over = t + 1, terminated or truncated
        if t % stride == 0 or is_over:
            pictures.append(_picture(env, model, data))
    return np.round(np.stack(pictures) / UNIT).astype("<i2"), t, bool(info["is_success"])


def _parts(model: Any) -> Array:
    """Numbers of the spheres and capsules of a robot."""
    kinds = (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE)
    return np.flatnonzero(np.isin(model.geom_type, kinds) & (model.geom_bodyid > 0))


def _picture(env: Any, model: Any, data: Any) -> Float64Array:
    """Both ends (parts, 6) of the axis of each part, in meters."""
    env.unwrapped.simulation.write_data(0, data)
    parts = _parts(model)
    axes = data.geom_xmat[parts].reshape(-1, 3, 3)[:, :, 2] * model.geom_size[parts, 1:2]
    centers = data.geom_xpos[parts]
    return np.hstack([centers - axes, centers + axes])


if __name__ == "__main__":
    record()
