"""From an environment to a policy that works: search by restored states, then learn."""

from __future__ import annotations

from contextlib import closing
from typing import Any, cast

import torch as th
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import MaybeCallback
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.algorithms.go_explore import GoExplore
from curiosity_algos.evaluation.environments import MakeEnv
from curiosity_algos.evaluation.found import N_FOUND
from curiosity_algos.robust.robustify import as_list, check_training, maker_of, robustify
from curiosity_gym.validation import check_whole


class Enough(BaseCallback):
    """Ends a search that has found so many episodes.

    Args:
        n_episodes: Number of episodes, from 1 to 10.
    """

    model: GoExplore

    def __init__(self, n_episodes: int) -> None:
        super().__init__()
        check_whole(1, N_FOUND, n_episodes=n_episodes)
        self.n_episodes = n_episodes

    def is_over(self, search: Any) -> bool:
        """Whether a search has found them."""
        return len(search.episodes) >= self.n_episodes

    def _on_step(self) -> bool:
        return not self.is_over(self.model)


def solve(
    env: str | MakeEnv,
    *,
    search_timesteps: float = 1e7,
    total_timesteps: float = 1e7,
    n_episodes: int = N_FOUND,
    success: float = 0.95,
    seed: int | None = None,
    device: th.device | str = "auto",
    callback: MaybeCallback = None,
    progress_bar: bool = False,
) -> PPO:
    """Find episodes that succeed with `GoExplore`, then train a policy by them with `robustify`.

    Nothing of the environment is known but its observations and its sparse reward. An episode
    succeeds if its last info says `is_success`, or else if its return is above 0. Where starts are
    drawn, the search is from one of them; the training is from all.

    Args:
        env: Id of the environment, or a function that makes it.
        search_timesteps: Environment steps of the search at most.
        total_timesteps: Environment steps of the training at most.
        n_episodes: Episodes from its one start that end the search, from 1 to 10; the best of
            them is learned from.
        success: Share of unseen starts that ends the training, in (0, 1].
        seed: Of all draws; None: fresh entropy.
        device: Where the networks are, as in SB3.
        callback: SB3 callbacks, of the search and of the training.
        progress_bar: Show a bar of each.

    Returns:
        The model of Stable-Baselines3.

    Raises:
        ValueError: If the search finds no episode, or an argument is out of its range.
    """
    budgets = {"search_timesteps": search_timesteps, "total_timesteps": total_timesteps}
    check_training(success, seed, device, **budgets)
    enough = Enough(n_episodes)
    maker_of(None, env)  # raises where it is no id and no function
    search = GoExplore(env, seed=seed, device=device)
    with closing(cast("VecEnv", search.get_env())):
        search.learn(search_timesteps, [*as_list(callback), enough], progress_bar=progress_bar)
    if not search.episodes:
        raise found_nothing(search.num_timesteps)
    return robustify(
        search,
        env,
        total_timesteps=total_timesteps,
        success=success,
        seed=seed,
        device=device,
        callback=callback,
        progress_bar=progress_bar,
    )


def found_nothing(timesteps: int) -> ValueError:
    """The error of a search that has come to its end."""
    return ValueError(
        "`search_timesteps` must be enough to find an episode that succeeds: in "
        f"{timesteps:,} none did. An episode succeeds if its last info says `is_success`, or else "
        "if its return is above 0: where steps cost, say `is_success`."
    )
