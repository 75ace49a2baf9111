"""From found episodes to a policy that works from any start."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback, ConvertCallback
from stable_baselines3.common.type_aliases import MaybeCallback
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.evaluation.environments import FactoryVecEnv
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.robust.demonstrations import Demonstration, demonstrations_of
from curiosity_algos.robust.imitation import N_STEPS, Imitation, Standardized
from curiosity_algos.robust.measure import evaluate_starts
from curiosity_algos.robust.starts import DemonstrationStarts, share_of
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_gym import RecordEpisode
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.validation import check_positive, check_seed, check_share

N_ENVS = 32
SETTINGS: dict[str, Any] = {
    "n_steps": 256,
    "batch_size": 1024,
    "n_epochs": 6,
    "learning_rate": 3e-4,
    "clip_range": 0.2,
}
"""Of PPO."""
NET_ARCH, LOG_STD = [128, 128], -0.5
SHRINKING = 1_200_000
"""Timesteps in which steps shrink by 1 / e, once all starts are fresh: a constant rate forgets."""
SMALLEST_CLIP = 0.05
N_KEPT = 40
"""Steps of imitation after each of PPO's, so that what is ahead of the fronts is not forgotten."""
TEST_INTERVAL, N_TESTED = 250_000, 100
"""Timesteps between two tests of whether the policy works by now, and the starts of one."""
NEARLY = 0.25
"""Drawn actions that succeed so much less often than was asked for are not tested."""


def robustify(
    model: EvolutionaryAlgorithm | Sequence[Demonstration],
    env: str | Callable[[], gym.Env[Any, Any]] | None = None,
    *,
    total_timesteps: float = 1e7,
    success: float = 0.95,
    seed: int | None = None,
    device: th.device | str = "auto",
    callback: MaybeCallback = None,
    progress_bar: bool = False,
    tensorboard_log: str | None = None,
    verbose: int = 0,
) -> PPO:
    """Train a policy that succeeds from any start, by episodes that succeeded from one.

    The second phase of Go-Explore (Ecoffet et al. 2021): PPO begins by imitating the episodes.
    Its own begin near their ends first, see `DemonstrationStarts`, and further back as they
    succeed. Once all starts are those of the environment its steps shrink, until it succeeds as
    often as was asked for.

    Args:
        model: Search that has found an episode, or demonstrations.
        env: Id of the environment, or a function that makes it; None: that of the search.
        total_timesteps: Environment steps at most.
        success: Share of unseen starts that ends the training, in (0, 1].
        seed: Of all draws; None: fresh entropy.
        device: Where the networks are, as in SB3.
        callback: SB3 callbacks.
        progress_bar: Show SB3's bar of timesteps.
        tensorboard_log: As in SB3.
        verbose: As in SB3.

    Returns:
        The model of Stable-Baselines3. Its policy takes observations as they are.

    Raises:
        ValueError: If no episode succeeded, one does not come to the same again, or an argument is
            out of its range.
    """
    check_positive(total_timesteps=total_timesteps, success=success)
    check_share(success=success)
    check_seed(seed)
    make = _maker(model, env)
    single = RecordEpisode(make())
    if isinstance(model, EvolutionaryAlgorithm):
        demonstrations = demonstrations_of(model, single)
    else:
        demonstrations = list(model)
    seeds = np.random.SeedSequence(seed).generate_state(4)
    ppo_seed, starts_seed, imitation_seed, test_seed = (int(s) for s in seeds >> 1)
    starts = DemonstrationStarts(_open(make, single), demonstrations, seed=starts_seed)
    learner = _make_ppo(starts, ppo_seed, device, tensorboard_log, verbose)
    with single_torch_thread():
        imitation = Imitation(learner, demonstrations, seed=imitation_seed)
        extractor = learner.policy.features_extractor
        if isinstance(extractor, Standardized):
            extractor.observe(imitation.observations)
        imitation.fit(N_STEPS)
        watch = Watch(starts, single, imitation, success=success, seed=test_seed)
        callbacks: list[BaseCallback] = [watch, *_as_list(callback)]
        learner.learn(int(total_timesteps), callbacks, progress_bar=progress_bar)
    return learner


def _as_list(callback: MaybeCallback) -> list[BaseCallback]:
    if callback is None or isinstance(callback, list):
        return callback or []
    return [callback if isinstance(callback, BaseCallback) else ConvertCallback(callback)]


def _maker(
    model: Any, env: str | Callable[[], gym.Env[Any, Any]] | None
) -> Callable[[], gym.Env[Any, Any]]:
    """A function that makes the environment."""
    if isinstance(env, str):
        return partial(gym.make, env)
    if env is not None:
        return env
    own: VecEnv | None = getattr(model, "env", None)
    if isinstance(own, FactoryVecEnv):
        make: Callable[[], gym.Env[Any, Any]] = own.make
        return make
    spec = None if own is None else own.get_attr("spec")[0]
    if spec is None:
        raise ValueError("`env` must be an id, or a function that makes the environment.")
    wrappers = tuple(wrapper for wrapper in spec.additional_wrappers if wrapper.name != "Monitor")
    return partial(gym.make, replace(spec, additional_wrappers=wrappers))


def _open(make: Callable[[], gym.Env[Any, Any]], single: gym.Env[Any, Any]) -> VecEnv:
    """`N_ENVS` environments, stepped at once where they can be."""
    spec = single.spec
    is_own = isinstance(single.unwrapped, EpisodicEnv)
    if is_own and spec is not None and not spec.additional_wrappers:
        batch = gym.make_vec(
            spec,
            num_envs=N_ENVS,
            vectorization_mode="vector_entry_point",
            autoreset_mode=AutoresetMode.SAME_STEP,
        )
        return GymnasiumVecEnv(batch)
    return DummyVecEnv([lambda: RecordEpisode(make())] * N_ENVS)


def _make_ppo(
    starts: DemonstrationStarts, seed: int, device: Any, tensorboard_log: str | None, verbose: int
) -> PPO:
    space = starts.observation_space
    policy_kwargs: dict[str, Any] = {"net_arch": NET_ARCH, "log_std_init": LOG_STD}
    if _is_of_vectors(space):
        policy_kwargs["features_extractor_class"] = Standardized
    return PPO(
        "MultiInputPolicy" if isinstance(space, spaces.Dict) else "MlpPolicy",
        VecMonitor(starts),
        policy_kwargs=policy_kwargs,
        gamma=_gamma(starts.demonstrations),
        seed=seed,
        device=device,
        tensorboard_log=tensorboard_log,
        verbose=verbose,
        **SETTINGS,
    )


def _gamma(demonstrations: Sequence[Demonstration]) -> float:
    """A discount that sees half of the longest demonstration."""
    longest = max(len(each) for each in demonstrations)
    return float(np.clip(1.0 - 2.0 / longest, 0.99, 0.9995))


def _is_of_vectors(space: spaces.Space[Any]) -> bool:
    is_floats = isinstance(space, spaces.Box) and np.issubdtype(space.dtype, np.floating)
    return is_floats and len(space.shape or ()) == 1


class Watch(BaseCallback):
    """Standardizes observations, shrinks the steps, logs the fronts, and ends the training.

    It remembers nothing from rollout to rollout that `DemonstrationStarts` does not know.

    Args:
        starts: Of the episodes.
        env: To test the policy in.
        imitation: Of what is ahead of the fronts.
        success: Share of starts that is enough.
        seed: Of the starts of the first test.
    """

    def __init__(
        self,
        starts: DemonstrationStarts,
        env: gym.Env[Any, Any],
        imitation: Imitation,
        *,
        success: float,
        seed: int,
    ) -> None:
        super().__init__()
        self.starts, self.env, self.imitation = starts, env, imitation
        self.success, self.seed = success, seed
        self.works = False
        self._n_tests = starts.free_steps // TEST_INTERVAL
        self._unseen: th.Tensor | None = None

    def _on_rollout_start(self) -> None:
        extractor = self.model.policy.features_extractor
        if self._unseen is not None and isinstance(extractor, Standardized):
            extractor.observe(self._unseen)  # not before: a rollout is learned as it was acted
        self._unseen = None
        if not self.starts.is_free:
            self.imitation.fit(N_KEPT, self.starts.fronts)
        self._shrink()
        self._test()

    def _shrink(self) -> None:
        share = math.exp(-self.starts.free_steps / SHRINKING)
        rate = SETTINGS["learning_rate"] * share
        clip = SMALLEST_CLIP + (SETTINGS["clip_range"] - SMALLEST_CLIP) * share
        learner: Any = self.model
        learner.lr_schedule, learner.clip_range = (lambda _: rate), (lambda _: clip)

    def _test(self) -> None:
        """Test the policy, if it is time and drawn actions succeed nearly as often."""
        n_tests = self.starts.free_steps // TEST_INTERVAL
        is_time, self._n_tests = n_tests > self._n_tests, n_tests
        if not is_time or share_of(self.starts.fresh_results) < self.success - NEARLY:
            return
        seed = self.seed + n_tests * N_TESTED
        tested = evaluate_starts(self.model, self.env, N_TESTED, seed=seed)
        self.logger.record("robust/tested", tested.share)
        self.works = tested.share >= self.success

    def _on_rollout_end(self) -> None:
        self._unseen = th.as_tensor(self.locals["rollout_buffer"].observations).flatten(0, 1)
        lengths = np.array([len(each) for each in self.starts.demonstrations])
        self.logger.record("robust/front", float(np.mean(self.starts.fronts / lengths)))
        near = [share_of(results) for results in self.starts.near]
        self.logger.record("robust/near", float(np.mean(near)))
        self.logger.record("robust/fresh", share_of(self.starts.fresh_results))

    def _on_step(self) -> bool:
        return not self.works
