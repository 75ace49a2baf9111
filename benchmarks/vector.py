"""Many environments at once, beside Gymnasium's own ways to vectorize the same maze."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecEnv

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from curiosity_algos import GymnasiumVecEnv

MAZE = "CuriosityMaze-Hard-v0"
N_ENVS, N_SYNC = 1024, 64
UNIT = "M steps/s"


def run(plan: Plan) -> list[Table]:
    """Environment steps a second of each way; the worker processes are started beforehand."""
    adapted, dummy = f"the same as a VecEnv, {N_ENVS} envs", f"DummyVecEnv of {N_SYNC}"
    native, sync = f"native, {N_ENVS} envs, two threads", f"SyncVectorEnv of {N_SYNC}"
    n_async = plan.size(8, 2)
    asynchronous = f"AsyncVectorEnv of {n_async}"
    # Spawned: a fork would copy the threads' locks in whatever state they are.
    spawned = {"context": "spawn"}
    envs = {
        native: gym.make_vec(MAZE, N_ENVS, "vector_entry_point", n_threads=2),
        sync: gym.make_vec(MAZE, N_SYNC, "sync"),
        asynchronous: gym.make_vec(MAZE, n_async, "async", vector_kwargs=spawned),
    }
    tasks = {name: vector_task(env, plan) for name, env in envs.items()}
    same_step = gym.make_vec(
        MAZE, N_ENVS, "vector_entry_point", n_threads=2, autoreset_mode=AutoresetMode.SAME_STEP
    )
    venvs = {adapted: GymnasiumVecEnv(same_step), dummy: make_vec_env(MAZE, N_SYNC)}
    tasks |= {name: vector_task(venv, plan) for name, venv in venvs.items()}
    figures = interleave(tasks, plan.repeats)
    for each in (*envs.values(), *venvs.values()):
        each.close()
    rows = [
        Row(native, figures[native], UNIT, ">= 2"),
        Row(sync, figures[sync], UNIT),
        Row(asynchronous, figures[asynchronous], UNIT),
        Row("native over SyncVectorEnv", ratios(figures[native], figures[sync]), "x"),
        Row("native over AsyncVectorEnv", ratios(figures[native], figures[asynchronous]), "x"),
        Row(adapted, figures[adapted], UNIT),
        Row(dummy, figures[dummy], UNIT),
        Row("as a VecEnv over DummyVecEnv", ratios(figures[adapted], figures[dummy]), "x", ">= 5"),
    ]
    return [Table(f"vector: {MAZE}", rows, ["Steps of all environments together."])]


def vector_task(env: gym.vector.VectorEnv[Any, Any, Any] | VecEnv, plan: Plan) -> Task:
    """Million environment steps a second over fixed actions."""
    # More steps of a small batch, so that every repeat lasts long enough.
    n_steps = max(plan.size(1000, 3), plan.size(20_000, 30) // env.num_envs)
    rng = np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (n_steps, env.num_envs, 2)).astype(np.float32)

    def loop() -> None:
        for action in actions:
            env.step(action)

    env.reset()
    env.step(actions[0])
    return lambda: n_steps * env.num_envs / seconds(loop) / 1e6
