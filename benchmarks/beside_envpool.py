"""Control tasks and robots in batches, beside EnvPool's of the same name."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from benchmarks.locomotion import endless
from benchmarks.measure import Plan, Row, Table, Task, add_peer, interleave, ratios, seconds
from benchmarks.population import POPULATION_SIZE
from curiosity_gym.processors import available_cpus

TASKS = {
    "BallInCup": ("CuriosityControl-BallInCup-v0", "BallInCupCatch-v1"),
    "Finger": ("CuriosityControl-Finger-v0", "FingerTurnHard-v1"),
    **{
        robot: (f"CuriosityLocomotion-{robot}-v0", f"{robot}-v5")
        for robot in ("HalfCheetah", "Ant", "Humanoid")
    },
}
"""Ids here and in EnvPool, which has no stacker with one box."""
HERE, PEER = "here", "EnvPool"
NOTES = [
    f"{POPULATION_SIZE} environments on all threads take the same actions, drawn uniformly, for "
    "200 steps: the vector environments here, and EnvPool's in its synchronous mode. Ours of "
    "control begin at fixed starts, EnvPool's at dm_control's random ones. Robots go on where they "
    "have fallen. Steps are those of all environments together; one that only begins an episode "
    "does not count."
]


def run(plan: Plan) -> list[Table]:
    """One table of all tasks."""
    rows: list[Row] = []
    notes = list(NOTES)
    for name in TASKS:
        figures = interleave(tasks(name, plan, notes), plan.repeats)
        rows += [Row(f"{name}, {what}", values, "steps/s") for what, values in figures.items()]
        if PEER in figures:
            rows.append(Row(f"{name}, over {PEER}", ratios(figures[HERE], figures[PEER]), "x"))
    return [Table("envpool: a batch of environments", rows, list(dict.fromkeys(notes)))]


def tasks(name: str, plan: Plan, notes: list[str]) -> dict[str, Task]:
    """Steps a second here, and of EnvPool where it is installed."""
    ours, theirs = TASKS[name]
    kwargs: dict[str, Any] = {"env_kwargs": endless(name)} if "Locomotion" in ours else {}
    envs = gym.make_vec(
        ours, POPULATION_SIZE, "vector_entry_point", n_threads=available_cpus(), **kwargs
    )
    shape = (plan.size(200, 5), *envs.action_space.shape)
    low, high = envs.action_space.low, envs.action_space.high
    actions = np.random.default_rng(0).uniform(low, high, shape).astype(np.float32)
    made = {HERE: rate_task(envs, actions)}
    add_peer(made, notes, PEER, partial(peer_task, theirs, actions, endless(name)))
    return made


def peer_task(env_id: str, actions: np.ndarray, kwargs: dict[str, Any]) -> Task:
    """Steps a second of EnvPool over actions (n_steps, n, A)."""
    import envpool

    envs = envpool.make(
        env_id,
        env_type="gymnasium",
        num_envs=actions.shape[1],
        num_threads=available_cpus(),
        **kwargs,
    )
    return rate_task(envs, actions.astype(envs.action_space.dtype))


def rate_task(envs: Any, actions: np.ndarray) -> Task:
    """Steps a second of a batch of environments over actions (n_steps, n, A)."""

    def replay() -> int:
        ends = [np.logical_or(*envs.step(each)[2:4]).sum() for each in actions]
        return actions[..., 0].size - int(sum(ends[:-1]))  # the next step of each begins an episode

    def rate() -> float:
        envs.reset()
        n_steps: list[int] = []
        elapsed = seconds(lambda: n_steps.append(replay()))
        return n_steps[0] / elapsed

    return rate
