"""The sparse control tasks, beside Shimmy's environments and the bare physics of dm_control."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import numpy.typing as npt
from gymnasium.envs.registration import EnvSpec

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from benchmarks.population import POPULATION_SIZE, random_policies
from benchmarks.python_loop import loop_task
from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.extras import import_extra
from curiosity_gym.processors import available_cpus

Float64Array = npt.NDArray[np.float64]
Episodes = list[Float64Array]
"""The actions (L, A) of each episode until it ended."""

N_ASYNC = 8
TARGETS = {"BallInCup": 0.85, "Finger": 0.75, "Stacker": 0.85}
"""Share of the bare physics' speed that an evaluation on one thread should reach."""
SHIMMY = {
    "BallInCup": "dm_control/ball_in_cup-catch-v0",
    "Finger": "dm_control/finger-turn_hard-v0",
}
"""Shimmy has no id of the stacker with one box."""
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
UNIT = "steps/s"

ONE, ALL = "one thread", "all threads"
VECTOR_ONE, VECTOR_ALL = "vector env, one thread", "vector env, all threads"
SINGLE, ASYNC = "Shimmy's env", f"AsyncVectorEnv of {N_ASYNC}"
BARE = "bare physics"
NOTES = [
    f"{POPULATION_SIZE} policies with hidden layers (32, 16) in closed loop, one episode each, on "
    "one thread and on all. The vector env and the bare physics replay these episodes: same start, "
    "same actions, same states.",
    "Bare physics is one simulation on one thread, stepped as dm_control steps it (mj_step2, "
    "mj_step, mj_step1), with nothing else in the loop but the writing of the action.",
    "Shimmy's envs, one alone or in AsyncVectorEnv's processes, get the same actions but begin at "
    "dm_control's random starts. Steps are control steps of all environments together.",
]


def run(plan: Plan) -> list[Table]:
    """A table for each task."""
    return [_table(name, plan) for name in TARGETS]


def _table(name: str, plan: Plan) -> Table:
    figures = interleave(tasks(name, plan), plan.repeats)
    rows = [Row(what, values, UNIT) for what, values in figures.items()]
    targets = {
        (ONE, BARE): f">= {TARGETS[name]}",
        (VECTOR_ONE, BARE): "",
        (ALL, ONE): "",
        (ALL, ASYNC): ">= 5",
        (ALL, SINGLE): "",
    }
    for (ours, other), target in targets.items():
        rows.append(Row(f"{ours} over {other}", ratios(figures[ours], figures[other]), "x", target))
    return Table(f"control: CuriosityControl-{name}-v0", rows, NOTES)


def tasks(name: str, plan: Plan) -> dict[str, Task]:
    """What is measured, all of it over the episodes of the same policies."""
    env = gym.make(f"CuriosityControl-{name}-v0", horizon=plan.size(1000, 20))
    n_threads = available_cpus()
    one, many = make_evaluator(env, n_threads=1), make_evaluator(env, n_threads=n_threads)
    parameters = random_policies(one)
    rollouts = many.evaluate(parameters)
    one.evaluate(parameters)
    pairs = zip(rollouts.trajectories[1], rollouts.lengths, strict=True)
    episodes = [actions[:length].astype(np.float64) for actions, length in pairs]

    def rate(evaluator: Evaluator) -> float:
        return rollouts.timesteps / seconds(lambda: evaluator.evaluate(parameters))

    # What is compared takes its turns side by side.
    return {
        BARE: bare_task(name, episodes, env.unwrapped.task),
        ONE: partial(rate, one),
        VECTOR_ONE: vector_task(name, episodes, 1, plan),
        VECTOR_ALL: vector_task(name, episodes, n_threads, plan),
        ALL: partial(rate, many),
        ASYNC: async_task(partial(make_peer, name), streams(episodes[:N_ASYNC], plan.size(500, 5))),
        SINGLE: loop_task(make_peer(name), np.concatenate(episodes)[: plan.size(10_000, 100)]),
    }


def vector_task(name: str, episodes: Episodes, n_threads: int, plan: Plan) -> Task:
    """Steps a second of the vector env; a step that only begins an episode does not count."""
    n_steps = plan.size(1000, 20)
    envs = gym.make_vec(
        f"CuriosityControl-{name}-v0", len(episodes), "vector_entry_point", n_threads=n_threads
    )
    actions = streams(episodes, n_steps).astype(np.float32)
    n_resets = sum(n_steps // (len(episode) + 1) for episode in episodes)

    def replay() -> None:
        for action in actions:
            envs.step(action)

    def rate() -> float:
        envs.reset()
        return (n_steps * len(episodes) - n_resets) / seconds(replay)

    return rate


def streams(episodes: Episodes, n_steps: int) -> Float64Array:
    """Each env's actions (n_steps, n, A): its episode over and over, a row a reset in between."""
    cycles = [np.pad(episode, [(0, 1), (0, 0)]) for episode in episodes]
    return np.stack([np.resize(cycle, (n_steps, cycle.shape[1])) for cycle in cycles], axis=1)


def async_task(make: Callable[[], gym.Env[Any, Any]], actions: npt.NDArray[Any]) -> Task:
    """Steps a second of n envs over actions (n_steps, n, A).

    The worker processes live only while this is measured.
    """

    def rate() -> float:
        makers = [make] * actions.shape[1]
        # A plain fork may inherit a lock of MuJoCo's that another thread holds.
        with closing(gym.vector.AsyncVectorEnv(makers, context="forkserver")) as envs:
            envs.reset(seed=0)
            envs.step(actions[0])
            return actions[..., 0].size / seconds(lambda: [envs.step(each) for each in actions])

    return rate


def make_peer(name: str) -> gym.Env[Any, Any]:
    """Shimmy's env of the same task, with gym.make's default wrappers."""
    (shimmy,) = import_extra("control", "shimmy")
    gym.register_envs(shimmy)
    if name in SHIMMY:
        return gym.make(SHIMMY[name])
    return gym.make(EnvSpec("dm_control/stacker-stack_1-v0", entry_point=stack_1))


def stack_1(**kwargs: Any) -> gym.Env[Any, Any]:
    """The stacker with one box, made as dm_control makes those with two and four."""
    from dm_control.rl import control
    from dm_control.suite import stacker
    from shimmy.dm_control_compatibility import DmControlCompatibilityV0

    physics = stacker.Physics.from_xml_string(*stacker.make_model(n_boxes=1))
    task = stacker.Stack(n_boxes=1, fully_observable=True)
    env = control.Environment(physics, task, control_timestep=0.01, time_limit=10)
    return DmControlCompatibilityV0(env, **kwargs)


def bare_task(name: str, episodes: Episodes, task: ControlTask) -> Task:
    """Steps a second of the physics alone, with dm_control's own model."""
    model = make_peer(name).unwrapped.physics.model.ptr
    data, start = mujoco.MjData(model), task.start_state(model)
    n_steps = sum(map(len, episodes))

    def replay() -> None:
        for episode in episodes:
            bare_episode(model, data, start, episode, task.n_substeps)

    return lambda: n_steps / seconds(replay)


def bare_episode(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    start: Float64Array,
    actions: Float64Array,
    n_substeps: int,
) -> None:
    """What dm_control calls of MuJoCo in an episode, and nothing else."""
    mujoco.mj_setState(model, data, start, STATE)
    mujoco.mj_step1(model, data)
    control = data.ctrl
    for action in actions:
        control[:] = action
        mujoco.mj_step2(model, data)
        mujoco.mj_step(model, data, n_substeps - 1)
        mujoco.mj_step1(model, data)
