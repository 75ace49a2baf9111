"""Gymnasium's MuJoCo robots in batches, beside Gymnasium's own environments and bare physics."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import numpy.typing as npt

from benchmarks.control import ALL, ASYNC, BARE, N_ASYNC, ONE, UNIT, VECTOR_ALL, async_task
from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from benchmarks.population import POPULATION_SIZE, random_policies
from benchmarks.python_loop import loop_task
from curiosity_algos import make_evaluator
from curiosity_gym.locomotion.tasks import LocomotionTask
from curiosity_gym.processors import available_cpus

ROBOTS = ("Ant", "Humanoid", "HalfCheetah", "Walker2d", "Hopper", "Swimmer")
TARGETED = ("Ant", "Humanoid")
SINGLE = "Gymnasium's env"
NOTES = [
    f"{POPULATION_SIZE} policies with hidden layers (32, 16) in closed loop, on one thread and on "
    "all, of robots that go on where they have fallen, for 200 steps. The others replay their "
    "actions. Bare physics is one simulation on one thread: `mj_step`, with nothing else in the "
    "loop but the writing of the action. Steps are those of all environments together."
]


def run(plan: Plan) -> list[Table]:
    """A table for each robot."""
    return [_table(robot, plan) for robot in ROBOTS[: plan.size(len(ROBOTS), 1)]]


def _table(robot: str, plan: Plan) -> Table:
    figures = interleave(tasks(robot, plan), plan.repeats)
    rows = [Row(what, values, UNIT) for what, values in figures.items()]
    bare, peer = (">= .9", ">= 5") if robot in TARGETED else ("", "")
    targets = {(ONE, BARE): bare, (ALL, ONE): "", (ALL, ASYNC): peer, (VECTOR_ALL, ASYNC): peer}
    for (ours, other), target in targets.items():
        rows.append(Row(f"{ours} over {other}", ratios(figures[ours], figures[other]), "x", target))
    return Table(f"locomotion: {robot}-v5", rows, NOTES)


def tasks(robot: str, plan: Plan) -> dict[str, Task]:
    """What is measured, all of it with the actions of the same policies."""
    n_steps, n_threads = plan.size(200, 5), available_cpus()
    env_kwargs = endless(robot)
    env = gym.make(f"CuriosityLocomotion-{robot}-v0", horizon=n_steps, env_kwargs=env_kwargs)
    evaluators = {ONE: make_evaluator(env, n_threads=1), ALL: make_evaluator(env)}
    parameters = random_policies(evaluators[ONE])
    actions = evaluators[ALL].evaluate(parameters, seed=0).trajectories[1].swapaxes(0, 1)
    evaluators[ONE].evaluate(parameters, seed=0)

    def rate(name: str) -> float:
        return actions[..., 0].size / seconds(lambda: evaluators[name].evaluate(parameters, seed=0))

    return {
        BARE: bare_task(env.unwrapped.task, actions),
        ONE: partial(rate, ONE),
        VECTOR_ALL: vector_task(robot, actions, n_threads),
        ALL: partial(rate, ALL),
        ASYNC: async_task(partial(gym.make, f"{robot}-v5", **env_kwargs), actions[:, :N_ASYNC]),
        SINGLE: loop_task(gym.make(f"{robot}-v5", **env_kwargs), actions[:, 0]),
    }


def endless(robot: str) -> dict[str, Any]:
    """Keywords of Gymnasium's environment with which a robot goes on where it has fallen."""
    falls = robot in ("Ant", "Humanoid", "Hopper", "Walker2d")
    return {"terminate_when_unhealthy": False} if falls else {}


def bare_task(task: LocomotionTask, actions: npt.NDArray[np.float32]) -> Task:
    """Steps a second of the physics alone."""
    data = mujoco.MjData(task.model)
    controls = actions.swapaxes(0, 1).astype(np.float64)
    starts = [task.draw(np.random.default_rng(0)) for _ in controls]

    def replay() -> None:
        for (qpos, qvel), episode in zip(starts, controls, strict=True):
            mujoco.mj_resetData(task.model, data)
            data.qpos[:], data.qvel[:] = qpos, qvel
            for control in episode:
                data.ctrl[:] = control
                mujoco.mj_step(task.model, data, task.frame_skip)

    return lambda: actions[..., 0].size / seconds(replay)


def vector_task(robot: str, actions: npt.NDArray[np.float32], n_threads: int) -> Task:
    """Steps a second of the native vector env."""
    keywords = {"env_kwargs": endless(robot), "n_threads": n_threads}
    kind = {"num_envs": actions.shape[1], "vectorization_mode": "vector_entry_point"}
    envs = gym.make_vec(f"CuriosityLocomotion-{robot}-v0", **kind, **keywords)

    def rate() -> float:
        envs.reset(seed=0)
        return actions[..., 0].size / seconds(lambda: [envs.step(each) for each in actions])

    return rate
