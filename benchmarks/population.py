"""Closed-loop evaluation of a population, beside Kheperax's snake maze."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt

from benchmarks.measure import (
    Figures,
    Plan,
    Row,
    Table,
    Task,
    add_peer,
    interleave,
    ratios,
    seconds,
)
from benchmarks.roofline import loops_task
from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from curiosity_gym.compiled import ThreadPool

POPULATION_SIZE = 56
HIDDEN = (32, 16)
N_BEAMS = 32
DEVIATION = 0.3
"""Of the policies' weights, as the search samples them around its first center."""
MAZES = ("Snake", "US", "Hard", "Labyrinth")
UNIT = "M steps/s"
KHEPERAX = "Kheperax, snake, jitted and vmapped"
ROOF = (
    "The roof is the rate of multiplying and adding in the first cache, on as many threads, and a "
    "step no more than its policy's products: walls and beams are not counted."
)


def run(plan: Plan) -> list[Table]:
    """Threads and Kheperax on the snake maze; then every maze on one thread."""
    return [_beside_kheperax(plan), _layouts(plan)]


def _beside_kheperax(plan: Plan) -> Table:
    one, two = "one thread", "two threads"
    tasks = {one: maze_task("Snake", 1, plan), two: maze_task("Snake", 2, plan)}
    tasks |= roof_tasks(plan, 1, 2)
    notes = [
        f"{POPULATION_SIZE} policies with hidden layers {HIDDEN} and {N_BEAMS} beams; Kheperax may "
        "use every core, runs episodes of its default length and keeps no trajectories.",
        ROOF,
    ]
    add_peer(tasks, notes, KHEPERAX, lambda: kheperax_task(plan))
    figures = interleave(tasks, plan.repeats)
    rows = [
        Row(one, figures[one], UNIT, ">= 2.5", of_roof(figures, one, 1)),
        Row(two, figures[two], UNIT, of_roof=of_roof(figures, two, 2)),
        Row("scaling, two threads over one", ratios(figures[two], figures[one]), "x", ">= 1.8"),
    ]
    if KHEPERAX in figures:
        peer = figures[KHEPERAX]
        rows += [
            Row(KHEPERAX, peer, UNIT),
            Row("two threads over Kheperax", ratios(figures[two], peer), "x", ">= 30"),
            Row("one thread over Kheperax", ratios(figures[one], peer), "x"),
        ]
    return Table("population: CuriosityMaze-Snake-v0", rows, notes)


def _layouts(plan: Plan) -> Table:
    tasks = {f"{name}, one thread": maze_task(name, 1, plan) for name in MAZES}
    figures = interleave(tasks | roof_tasks(plan, 1), plan.repeats)
    rows = [Row(name, figures[name], UNIT, of_roof=of_roof(figures, name, 1)) for name in tasks]
    return Table("population: every maze", rows, [ROOF])


def roof_tasks(plan: Plan, *numbers: int) -> dict[str, Task]:
    """For each number of threads what they can do at most, see `ROOF`."""
    return {_roof(n): loops_task(plan, ThreadPool(n), n) for n in numbers}


def of_roof(
    figures: Mapping[str, Figures], name: str, n_threads: int, n_beams: int = N_BEAMS
) -> Figures:
    """Shares of the roof that the steps of a policy of so many beams take, one a repeat."""
    sizes = n_beams + 4, *HIDDEN, 2
    operations = 2e-3 * sum(a * b for a, b in pairwise(sizes))  # billions, of a million steps
    return [operations * share for share in ratios(figures[name], figures[_roof(n_threads)])]


def _roof(n_threads: int) -> str:
    return f"roof, {n_threads} threads"


def random_policies(evaluator: Evaluator, n: int = POPULATION_SIZE) -> npt.NDArray[np.float32]:
    """Parameters (n, ...) as the search samples them around its first center, always the same."""
    parameters = np.random.default_rng(0).normal(0.0, DEVIATION, (n, evaluator.n_parameters))
    return parameters.astype(np.float32)


def maze_task(name: str, n_threads: int, plan: Plan) -> Task:
    """Million environment steps a second of one evaluation, all kernels compiled."""
    horizon = plan.size(2000, 50)
    env = gym.make(f"CuriosityMaze-{name}-v0", n_beams=N_BEAMS, horizon=horizon)
    evaluator = make_evaluator(env, {"net_arch": list(HIDDEN)}, n_threads)
    parameters = random_policies(evaluator)
    n_evaluations = plan.size(10, 1)
    timesteps = n_evaluations * evaluator.evaluate(parameters).timesteps

    def evaluate() -> None:
        for _ in range(n_evaluations):
            evaluator.evaluate(parameters)

    return lambda: timesteps / seconds(evaluate) / 1e6


def kheperax_task(plan: Plan) -> Task:
    """The same of Kheperax, compiled: its snake map with as many lasers and as large policies.

    Raises:
        ImportError: If Kheperax or one of its dependencies is not installed.
    """
    import jax
    from jax import numpy as jnp
    from kheperax.tasks.config import KheperaxConfig
    from kheperax.tasks.main import KheperaxTask
    from qdax.core.neuroevolution.networks.networks import MLP

    config = KheperaxConfig.get_default_for_map("snake")
    angles = jnp.linspace(0.0, 2.0 * jnp.pi, N_BEAMS, endpoint=False)
    config.robot = config.robot.replace(laser_angles=angles)
    config.episode_length = plan.size(config.episode_length, 20)
    task = KheperaxTask(config)
    initializer = jax.nn.initializers.normal(DEVIATION)
    policy = MLP((*HIDDEN, task.action_size), kernel_init=initializer, final_activation=jnp.tanh)
    keys = jax.random.split(jax.random.PRNGKey(0), POPULATION_SIZE)
    parameters = jax.vmap(policy.init, (0, None))(keys, jnp.zeros(task.observation_size))

    def episode(individual: Any, key: Any) -> Any:
        def step(state: Any, _: None) -> tuple[Any, None]:
            return task.step(state, policy.apply(individual, state.obs)), None

        state, _ = jax.lax.scan(step, task.reset(key), length=config.episode_length)
        return state.info["state_descriptor"]

    rollout = jax.jit(jax.vmap(episode))
    timesteps = POPULATION_SIZE * config.episode_length

    def evaluate() -> None:
        jax.block_until_ready(rollout(parameters, keys))

    evaluate()
    return lambda: timesteps / seconds(evaluate) / 1e6
