"""Go-Explore: return to a state that was reached before, then explore on from there.

Ecoffet et al. 2021, "First return, then explore" (Nature 590, https://arxiv.org/abs/2004.12919).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.type_aliases import GymEnv

from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.evaluation.environments import EnvObject
from curiosity_algos.evaluation.found import BestEpisodes
from curiosity_algos.evaluation.open_loop import OpenLoopPolicy
from curiosity_algos.evaluation.places import Place, Places, Trail
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.evaluation.worlds import Worlds, another, make_worlds
from curiosity_algos.loops.declared import setting
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.motivations.learned_behavior import LearnedBehavior
from curiosity_algos.search.exploration import Visit, explore
from curiosity_algos.search.explorers import EXPLORERS, Explorers
from curiosity_gym.validation import check_at_least_one, check_bool, check_choice, check_positive

LEARNED, CELLS, AUTO = "learned", "cells", "auto"
N_CHECKED = 20
"""Steps that are played twice before a search, to see that an environment plays them again."""
SEEN = "observation"
"""The field of a state that its learned behavior is measured from."""


class GoExplore(EvolutionaryAlgorithm):
    """Keeps states apart, returns to those that it has returned to least, and explores from there.

    An exploration takes `n_steps` further steps of the episode that led to a state. States on its
    way are kept if they are unlike those that are, or reached in fewer steps. All episodes begin at
    one start, that of a reset with a seed that is drawn once. Timesteps count the explorations, not
    the way to where they begin: the environment is restored there. That is another problem than the
    other algorithms solve, which play every episode from its start.

    This package's environments and Gymnasium's robots are restored from the state of their physics,
    in one call for all. Others take their actions again from the start, or are copied.

    What is found is an episode, no policy: `predict` takes the actions of the best one, whatever it
    observes, and only from the start of the search do they lead to the goal. `robustify(model)`
    trains a policy.

    `evaluator` and `policy_kwargs` must keep their defaults. Further keywords are those of
    `EvolutionaryAlgorithm`.

    Args:
        env: An environment id, a function that makes an environment, a Gymnasium env, or a vector
            environment of this package.
        behavior: What tells states apart: "learned", features of what is observed, as of `APT`; or
            "cells", those of the environment's `coverage_grid`.
        explorer: "held": random actions, each held for ten steps on average, and discrete ones for
            one to ten, which each exploration draws; "linear": a linear policy, a variation of the
            one that led to the state; "auto": both, and more often the one that comes further.
        population_size: Explorations a generation.
        n_steps: Steps of an exploration. Five times on the way it offers where it has come to.
        archive_size: States kept with learned behavior, within 10 %.
        sigma: Standard deviation of variations of policies, above 0.
        is_copied: Restore an environment of others by `copy.deepcopy`, not by its actions.

    Attributes:
        archive: The states: how they are told apart, the steps to there (negative, the objective),
            and the linear policy that led there.
        replayed_steps: Steps that environments took again on the ways to where explorations began.
            `num_timesteps` leaves them out. Neither counts the steps that check an episode: each
            that is kept is played once more.

    Raises:
        ValueError: If an argument is out of its range, the env has no cells, or cannot be restored.
    """

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": OpenLoopPolicy}
    behavior: str = setting(LEARNED, partial(check_choice, (LEARNED, CELLS)), fixed=True)
    explorer: str = setting(AUTO, partial(check_choice, (AUTO, *EXPLORERS)), fixed=True)
    population_size: int = setting(64, check_at_least_one)
    n_steps: int = setting(100, check_at_least_one)
    archive_size: int = setting(500, check_at_least_one)
    sigma: float = setting(0.3, check_positive)
    is_copied: bool = setting(False, check_bool, settled=True)
    policy: OpenLoopPolicy  # type: ignore[assignment]  # no network acts
    archive: UnstructuredArchive | SparseGridArchive
    replayed_steps = 0
    _progress = (*EvolutionaryAlgorithm._progress, "replayed_steps")

    @property
    def episodes(self) -> list[dict[str, Any]]:
        """The ten successful episodes of the highest returns, the best first.

        Of each the `start`, the seed of its reset, its `actions`, (T, ...), and the `total`, its
        return. Each was played from its start before it was kept.
        """
        return self._found.episodes

    @property
    def best_return(self) -> float:
        """Return of the best episode that was found; without any, the highest that was seen."""
        return round(self.episodes[0]["total"], 6) if self.episodes else super().best_return

    def _policy_kwargs(self, policy_kwargs: dict[str, Any] | None) -> dict[str, Any]:
        if policy_kwargs:
            raise ValueError(f"`policy_kwargs` must be None here, got {policy_kwargs!r}.")
        return {}

    def _check_behaviors(self, space: spaces.Box[Any] | None) -> None:
        if self.behavior == CELLS and self._coverage_grid is None:
            raise ValueError(
                '`behavior` "cells" needs an env with a bounded `behavior_space`: wrap it in '
                "curiosity_gym.BehaviorWrapper."
            )

    def _check_settings(self) -> None:
        super()._check_settings()
        self._check_behaviors(self._behavior_space)

    def _make_search(self, seed: np.random.SeedSequence) -> None:
        archive_seed, behavior_seed, explorers_seed, choices_seed = seed.spawn(4)
        names = EXPLORERS if self.explorer == AUTO else (self.explorer,)
        self._explorers = Explorers(names, self.policy, seed=explorers_seed)
        self._choices = np.random.default_rng(choices_seed)
        self._places, self._found = Places(self.policy.actions[:0]), BestEpisodes()
        if self.behavior == LEARNED:
            self._learned = LearnedBehavior(
                self.policy.seen.space,
                self.policy.acted.space,
                seed=behavior_seed,
                device=self.device,
                n_threads=self.n_threads,
            )
        self.archive = self._make_archive(archive_seed)

    def _make_archive(
        self, seed: np.random.SeedSequence
    ) -> UnstructuredArchive | SparseGridArchive:
        kwargs: dict[str, Any] = {
            "solution_dim": self.policy.mlp.n_parameters,
            "solution_dtype": np.float32,
            "extra_fields": {
                "place": ((), np.int64),
                SEEN: (self.policy.seen.space.shape, np.float32),
            },
            "seed": seed,
        }
        self._unit: Float64Array = np.ones(1)  # of distances
        if self.behavior == LEARNED:
            n, size = LearnedBehavior.n_features, self.archive_size
            return UnstructuredArchive(measure_dim=n, target_size=size, k_neighbors=None, **kwargs)
        grid = self._coverage_grid
        assert grid is not None
        self._unit = (grid.high - grid.low) / grid.n_cells
        ranges = list(zip(grid.low.tolist(), grid.high.tolist(), strict=True))
        return SparseGridArchive(dims=grid.shape, ranges=ranges, **kwargs)

    def _parts(self) -> dict[str, Any]:
        encoder = {"encoder": self._learned} if self.behavior == LEARNED else {}
        return {
            **super()._parts(),
            "archive": self.archive,
            "places": self._places,
            "explorers": self._explorers,
            "choices": self._choices,
            "found": self._found,
            **encoder,
        }

    def _put_in_force(self) -> None:
        super()._put_in_force()
        if isinstance(self.archive, UnstructuredArchive):
            self.archive.target_size = self.archive_size

    def _choose_evaluator(self, choice: Any, env: EnvObject) -> Worlds:
        if choice != "auto":
            raise ValueError(f'`evaluator` must be "auto" here, got {choice!r}.')
        return make_worlds(env, self.population_size, self.n_threads, is_copied=self.is_copied)

    @property
    def _worlds(self) -> Worlds:
        assert isinstance(self.evaluator, Worlds)
        return self.evaluator

    def set_env(self, env: GymEnv, force_reset: bool = True) -> None:
        """As there; the search begins anew, as its states are of the environment before."""
        super().set_env(env, force_reset)
        self._begin_anew()

    def _forget_behaviors(self) -> None:
        self.archive.clear()
        self._places.keep([])
        self._found.clear()

    def _begin(self) -> None:
        """Draw a start, see that episodes are played from there again, and keep it."""
        self._worlds.seed = self._episode_seed = int(self._episode_seeds.integers(2**31))
        start = self._places.start()
        self._worlds.check(start, self._explorers.walk(N_CHECKED))
        observations, behaviors = self._worlds.restore([start]), self._worlds.behaviors(1)
        self._keep([Visit(0, 0, start, observations[0], behaviors[0])], self._explorers.first())

    def _ask(self) -> Float32Array:
        if self.archive.empty:
            self._begin()
        places = [self._places[number] for number in self.archive.data("place")]
        weights = 1.0 / np.sqrt([1.0 + place.times_chosen for place in places])
        n = self.population_size
        self._chosen = self._choices.choice(len(places), n, p=weights / weights.sum())
        self._origins = [places[i] for i in self._chosen]
        self._begins = self.archive.data("measures")[self._chosen]
        parents = self.archive.data("solution")[self._chosen]
        self._plan = self._explorers.plan(parents, self.n_steps, self.sigma)
        return self._plan.policies

    def _play(self) -> tuple[Float32Array, Rollouts]:
        policies, worlds = self._ask(), self._worlds
        worlds.seed, before = self._episode_seed, worlds.replayed_steps
        places = self._origins
        act = partial(self._explorers.act, self._plan)
        taken = self.policy.acted.taken
        self._explored = explore(worlds, places, act, taken, self.n_steps, self._coverage_grid)
        self._check_restored(places, self._explored.rollouts)
        for place in places:
            place.times_chosen += 1
        self.replayed_steps += worlds.replayed_steps - before
        return policies, self._explored.rollouts

    def _check_restored(self, places: list[Place], rollouts: Rollouts) -> None:
        """Raise ValueError unless every exploration began where its episode had stood."""
        first = rollouts.trajectories[0][:, 0]
        is_same = (first == self.archive.data(SEEN)[self._chosen]).all(axis=1)
        if not is_same.all():
            raise another(places[int(np.argmin(is_same))].length)

    def _tell(self, rollouts: Rollouts) -> Mapping[str, float]:
        losses: Mapping[str, float] = {}
        if self.behavior == LEARNED:
            losses = self._learned.learn(rollouts, self.archive, SEEN)
        self._explorers.learn(self._plan, self._distances(rollouts), rollouts)
        self._keep(self._explored.visits, self._plan.policies)
        for trail, total in self._explored.found:
            self._remember(trail, total)
        shares = {f"explore/{name}": share for name, share in self._explorers.shares.items()}
        replayed = {"time/replayed_steps": self.replayed_steps} if self.replayed_steps else {}
        return {"archive/size": len(self.archive), **shares, **replayed, **losses}

    def _distances(self, rollouts: Rollouts) -> Float64Array:
        """How far (P,) each exploration came from where it began."""
        ends = self._measures(rollouts.final_observations, rollouts.behaviors)
        begins = self._begins
        if self.behavior == LEARNED:  # by what has been learned since
            begins = self._learned.of(rollouts.trajectories[0][:, 0])
        distances: Float64Array = np.linalg.norm((ends - begins) / self._unit, axis=1)
        return distances

    def _measures(self, observations: Float32Array, behaviors: Float64Array) -> Float64Array:
        """What tells states apart, (n, measure_dim)."""
        if self.behavior == LEARNED:
            return self._learned.of(observations)
        assert self._coverage_grid is not None
        return behaviors[:, self._coverage_grid.dimensions]

    def _keep(self, visits: list[Visit], policies: Float32Array) -> None:
        """Keep those that are unlike others, or reached sooner."""
        if not visits:
            return
        observations = np.stack([visit.observation for visit in visits])
        self.archive.add(
            policies[[visit.row for visit in visits]],
            [-visit.place.length for visit in visits],
            self._measures(observations, np.stack([visit.behavior for visit in visits])),
            place=self._places.add(visit.place for visit in visits),
            observation=observations,
        )
        self._places.keep(self.archive.data("place").tolist())

    def _remember(self, trail: Trail, total: float) -> None:
        """Keep an episode that is among the best, once it was played again from its start."""
        if not self._found.takes(total, trail.length):
            return
        again = 0.0
        for _, reward in self._worlds.follow(self._places.start(), trail.whole):
            again += reward
        if again != total:
            raise another(trail.length)
        self._found.add(total, self._episode_seed, trail.whole)

    def _run_generation(self) -> dict[str, Any]:
        # Policies explore from where others have led: by itself none comes to what it came to.
        return {**super()._run_generation(), "parameters": None}

    def _show_best(self) -> None:
        found = self.episodes
        self.policy.actions = found[0]["actions"] if found else self.policy.actions[:0]

    def _center(self) -> Float32Array:
        return np.zeros(self.policy.mlp.n_parameters, dtype=np.float32)
