"""Where a GPU pays: bonuses and whole runs, there and on the processor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm

from benchmarks.measure import Plan, Row, Table, Task, interleave, ratios, seconds
from benchmarks.off_policy import learn
from curiosity_algos import APT, ICM, RND, TD3ICM, CuriosityES
from curiosity_algos.bonuses.base import NetworkBonus
from curiosity_algos.common.networks import single_torch_thread

MAZE = "CuriosityMaze-US-v0"
VECTORS, IMAGES = spaces.Box(-1.0, 1.0, (36,)), spaces.Box(0, 255, (4, 84, 84), np.uint8)
INPUTS = {
    "256 of a maze's observations": (VECTORS, 256, 20_000),
    "2,048 of them": (VECTORS, 2048, 20_000),
    "64 images of 84 x 84 x 4": (IMAGES, 64, 2_000),
}
"""What bonuses see at once, and how many they have observed: as many as APT remembers."""
RUNS: Mapping[str, tuple[Callable[..., BaseAlgorithm], float]] = {
    "CuriosityES": (CuriosityES, 1e6),
    "CuriosityES, paper": (partial(CuriosityES.from_preset, "paper"), 1e6),
    "TD3ICM": (partial(TD3ICM, learning_starts=100, buffer_size=10_000), 2e3),
}
"""By name what makes a model of an environment, and its timesteps."""


def run(plan: Plan) -> list[Table]:
    """Rates of bonuses and of whole runs on each device."""
    devices = ["cpu", *(["cuda"] if th.cuda.is_available() else [])]
    gpu = f"GPU: {th.cuda.get_device_name()}." if len(devices) > 1 else "There is no GPU here."
    notes = [f"{gpu} Networks are on one thread of the processor; policies are always there."]
    bonuses: list[Row] = []
    with single_torch_thread():
        for (what, sizes), bonus in product(INPUTS.items(), (APT, ICM, RND)):
            bonuses += _bonus(plan, devices, f"{bonus.__name__}, {what}", bonus, *sizes)
    runs: list[Row] = []
    for name, (make, timesteps) in RUNS.items():
        n_steps = plan.size(int(timesteps), 120)
        tasks = {device: partial(_rate, plan, make, device, n_steps) for device in devices}
        runs += _rows(plan, name, "steps/s", tasks)
    return [Table("gpu: bonuses", bonuses, notes), Table(f"gpu: {MAZE}", runs, notes)]


def _bonus(
    plan: Plan,
    devices: list[str],
    name: str,
    cls: Callable[..., NetworkBonus],
    space: spaces.Box[Any],
    n: int,
    n_observed: int,
) -> list[Row]:
    """Transitions a second that are trained on, and that are scored."""
    space.seed(0)
    states = np.stack([space.sample() for _ in range(plan.size(n, 16) + 1)])
    observed = [space.sample() for _ in range(plan.size(n_observed, 16))]
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (len(states) - 1, 2)).astype(np.float32)
    batch = states[:-1], actions, states[1:]
    tensors = [th.from_numpy(each) for each in batch]
    made = {
        device: cls(space, spaces.Box(-1.0, 1.0, (2,)), seed=0, device=device) for device in devices
    }
    for bonus in made.values():
        bonus.observe(th.from_numpy(np.stack(observed)))

    def train(bonus: NetworkBonus) -> float:
        return 5 * len(actions) / seconds(lambda: [bonus.update(*tensors) for _ in range(5)])

    def score(bonus: NetworkBonus) -> float:
        bonus.score(*batch)  # which encodes what is remembered, once after a training
        return len(actions) / seconds(lambda: bonus.score(*batch))

    rows: list[Row] = []
    for stage, task in {"trained": train, "scored": score}.items():
        tasks = {device: partial(task, bonus) for device, bonus in made.items()}
        rows += _rows(plan, f"{name}, {stage}", "transitions/s", tasks)
    return rows


def _rate(plan: Plan, make: Callable[..., BaseAlgorithm], device: str, n_steps: int) -> float:
    """Steps a second of a new model."""
    env = gym.make(MAZE, horizon=plan.size(2000, 60))
    return learn(make(env=env, seed=0, device=device), n_steps)[0]


def _rows(plan: Plan, name: str, unit: str, tasks: Mapping[str, Task]) -> list[Row]:
    """The rate of each device, and the GPU's over the processor's."""
    for task in tasks.values():
        task()  # what is compiled or loaded, is now
    figures = interleave(tasks, plan.repeats)
    rows = [Row(f"{name}, {device}", rates, unit) for device, rates in figures.items()]
    if "cuda" in figures:
        rows.append(Row(f"{name}, GPU over CPU", ratios(figures["cuda"], figures["cpu"]), "x"))
    return rows
