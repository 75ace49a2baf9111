"""Which evaluator fits an environment."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import gymnasium as gym

from curiosity_algos.evaluation.environments import (
    MadeEnv,
    MadeVecEnv,
    MakeEnv,
    describe,
    open_env,
)
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.evaluation.policies import DEFAULT_NET_ARCH, Float32Array, Mlp, build_mlp
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.simulation import SimulationEvaluator
from curiosity_algos.evaluation.transparent import (
    bare,
    has_methods_of_its_own,
    is_exactly,
    max_steps,
    robot_task,
    time_limit,
    without_monitors,
)
from curiosity_algos.evaluation.vector import VectorEvaluator
from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.locomotion.locomotion_env import LocomotionEnv
from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import task_class
from curiosity_gym.locomotion.vector_env import LocomotionVectorEnv
from curiosity_gym.maze.maze_env import MazeEnv
from curiosity_gym.maze.vector_env import MazeVectorEnv
from curiosity_gym.validation import check_at_least_one

AnyEnv = MadeEnv | MakeEnv | str


class Evaluator(Protocol):
    """Plays one episode with each policy of a population.

    One that has a `block_size`, a whole number, is given no more policies at once by algorithms
    that can do without whole trajectories. One whose `draws` is False begins all episodes alike,
    whatever the seed.

    Attributes:
        n_parameters: Length of a policy's parameter vector.
    """

    n_parameters: int

    def evaluate(self, parameters: Float32Array, seed: int | None = None) -> Rollouts:
        """Play one episode of each policy.

        Args:
            parameters: (P, n_parameters), float32.
            seed: Every episode's reset gets it, so that individuals are compared on equal terms;
                environments that draw nothing ignore it.
        """
        ...


Fits = Callable[[Any], bool]
"""`fits(env)`: whether an evaluator can take the place of this environment."""
Make = Callable[[Any, Mlp, int | None], Evaluator]
"""`make(env, mlp, n_threads)`: the evaluator of an environment that fits."""


def make_evaluator(
    env: AnyEnv, policy_kwargs: dict[str, Any] | None = None, n_threads: int | None = None
) -> Evaluator:
    """The fastest evaluator that fits `env`: the first in `EVALUATORS` that does.

    Args:
        env: An id, a function that makes an environment, a Gymnasium env or VectorEnv, or an SB3
            VecEnv without wrappers. Of an id or a function as many environments as pay are made,
            each anew, where none of the compiled evaluators fits; an environment plays alone.
        policy_kwargs: `net_arch`, widths of the hidden layers (default 32, 16).
        n_threads: Threads of the compiled evaluators; None: as many as there are processors. Of an
            id or a function that has none of these: processes; None: this one alone.

    Raises:
        ValueError: If the env's spaces or its VecEnv wrappers are not supported, if another
            argument is out of its range, or if a registered `make` gives no evaluator of the
            policies.
    """
    if n_threads is not None:
        check_at_least_one(n_threads=n_threads)
    opened = open_env(env)
    mlp = build_mlp(*describe(opened), check_policy_kwargs(policy_kwargs))
    inner = without_monitors(opened)
    for fits, make in EVALUATORS:
        if fits(inner):
            made = make(inner, mlp, n_threads)
            _check_made(made, mlp.n_parameters)
            return made
    make_env = opened.make if isinstance(opened, MadeVecEnv) else None
    return VectorEvaluator(inner, mlp, make_env, n_threads or 1)


def _check_made(made: object, n_parameters: int) -> None:
    evaluates = callable(getattr(made, "evaluate", None))
    if not evaluates or getattr(made, "n_parameters", None) != n_parameters:
        raise ValueError(
            "`make` of a registered evaluator must give an object with `evaluate` and with "
            f"`n_parameters` = {n_parameters}, got {made!r:.60}."
        )


def register_evaluator(fits: Fits, make: Make) -> None:
    """Let `make_evaluator`, and with it every algorithm, choose an evaluator of one's own.

    It is asked before all that were registered earlier, and before those of this package.

    Args:
        fits: `fits(env)` says whether the evaluator can take the place of `env`: a Gymnasium env or
            VectorEnv, or an SB3 VecEnv. SB3's monitors are taken off before, and so is a
            DummyVecEnv around one env, or around mazes, tasks or robots that are the same;
            Gymnasium's wrappers are left on.
        make: `make(env, mlp, n_threads)` gives the evaluator. `mlp` is the policies' shape, an
            argument of `curiosity_algos.evaluation.policies.act`.

    Example:
        ::

            def fits(env):
                return type(env.unwrapped) is MyEnv


            def make(env, mlp, n_threads):
                return MyEvaluator(env.unwrapped, mlp)


            register_evaluator(fits, make)

    Raises:
        ValueError: If an argument is no function.
    """
    for name, value in {"fits": fits, "make": make}.items():
        if not callable(value):
            raise ValueError(f"`{name}` must be a function, got {value!r}.")
    EVALUATORS.insert(0, (fits, make))


def check_policy_kwargs(policy_kwargs: dict[str, Any] | None) -> list[int]:
    """The hidden layers' widths.

    Raises:
        ValueError: If a key other than `net_arch` is there, or `net_arch` is no list.
    """
    if not isinstance(policy_kwargs, dict | None):
        raise ValueError(f"`policy_kwargs` must be a dictionary or None, got {policy_kwargs!r}.")
    given = dict(policy_kwargs or {})
    net_arch = given.pop("net_arch", DEFAULT_NET_ARCH)
    if given:
        raise ValueError(f"`policy_kwargs` may hold `net_arch` alone, got {sorted(given)} too.")
    if not isinstance(net_arch, list | tuple):
        raise ValueError(f"`net_arch` must be a list of layer widths, got {net_arch!r}.")
    return list(net_arch)


# Exactly these types: a subclass may step or reward in another way.
def _is_maze(env: Any) -> bool:
    return is_exactly(bare(env), MazeEnv, MazeVectorEnv)


def _make_maze(env: Any, mlp: Mlp, n_threads: int | None) -> Evaluator:
    inner = bare(env)
    return MazeEvaluator(inner.maze, inner.coverage_grid, mlp, n_threads, max_steps(env))


def _is_control(env: Any) -> bool:
    return is_exactly(bare(env), ControlEnv, ControlVectorEnv)


def _make_control(env: Any, mlp: Mlp, n_threads: int | None) -> Evaluator:
    inner = bare(env)
    return SimulationEvaluator(
        inner.task,
        Simulation,
        mlp,
        max_steps=max_steps(env),
        horizon=inner.horizon,
        n_threads=n_threads,
    )


def _is_locomotion(env: Any) -> bool:
    return is_exactly(bare(env), LocomotionEnv, LocomotionVectorEnv)


def _make_locomotion(env: Any, mlp: Mlp, n_threads: int | None) -> Evaluator:
    inner = bare(env)
    return SimulationEvaluator(
        inner.task,
        LocomotionSimulation,
        mlp,
        max_steps=max_steps(env),
        horizon=inner.horizon if inner.sparse else None,
        n_threads=n_threads,
    )


def _is_gymnasium_robot(env: Any) -> bool:
    """Whether it is one of Gymnasium's own whose episodes end, and that has no window."""
    if not isinstance(env, gym.Env) or env.render_mode == "human" or time_limit(env) is None:
        return False
    return task_class(bare(env)) is not None and not has_methods_of_its_own(bare(env))


def _make_gymnasium_robot(env: Any, mlp: Mlp, n_threads: int | None) -> Evaluator:
    limit, task = time_limit(env), robot_task(bare(env))
    assert limit is not None
    assert task is not None
    return SimulationEvaluator(
        task, LocomotionSimulation, mlp, max_steps=limit, n_threads=n_threads
    )


EVALUATORS: list[tuple[Fits, Make]] = [
    (_is_maze, _make_maze),
    (_is_control, _make_control),
    (_is_locomotion, _make_locomotion),
    (_is_gymnasium_robot, _make_gymnasium_robot),
]
"""What `make_evaluator` chooses from: the first that fits, or else a `VectorEvaluator`."""
