"""The contract that every algorithm keeps: Stable-Baselines3's API, exactly counted and seeded."""

import dataclasses
import functools
import gc
import time
import weakref

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium.vector import SyncVectorEnv
from logs import read_log
from stable_baselines3.common.callbacks import (
    BaseCallback,
    EvalCallback,
    StopTrainingOnRewardThreshold,
)
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.logger import configure
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnv, VecNormalize

from curiosity_algos import (
    AURORA,
    CMAME,
    NSES,
    NSLC,
    TD3ICM,
    CanonicalES,
    CuriosityES,
    CuriosityMAPElites,
    MAPElites,
)
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.coverage import env_attribute
from curiosity_algos.evaluation.maze import MazeEvaluator
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm

HARD = "CuriosityMaze-Hard-v0"
GENERATION = 6 * 50
"""Timesteps of a generation of the small models on the maze whose goal is out of reach."""

HORIZONS = [64, 1999, 2000]
"""Short, where float32 holds every return; one that 10 does not divide; and the mazes' own."""

KEYS = {
    "rollout/ep_rew_mean",
    "rollout/ep_rew_max",
    "rollout/ep_len_mean",
    "rollout/success_rate",
    "search/sigma",
    "time/first_reward",
    "time/fps",
    "time/generations",
    "time/total_timesteps",
}
COVERAGE_KEYS = {"coverage/reachable", "coverage/visited", "coverage/all"}
ES_KEYS = {"search/norm"}
PHI_KEYS = {"search/phi"}
INTRINSIC_KEYS = {"intrinsic/mean", "intrinsic/max"}
ICM_KEYS = {"icm/loss", "icm/forward_loss", "icm/inverse_loss"}
ARCHIVE_KEYS = {"archive/size", "archive/qd_score", "archive/best"}
GRID_KEYS = ARCHIVE_KEYS | {"archive/coverage"}
OWN_KEYS = {
    CanonicalES: ES_KEYS,
    CuriosityES: ES_KEYS | PHI_KEYS | INTRINSIC_KEYS | {"apt/loss"},
    NSES: ES_KEYS | PHI_KEYS | INTRINSIC_KEYS | {"archive/size"},
    NSLC: ARCHIVE_KEYS | {"archive/threshold"},
    MAPElites: GRID_KEYS,
    CMAME: GRID_KEYS,
    AURORA: ARCHIVE_KEYS | {"archive/threshold", "autoencoder/loss"},
    CuriosityMAPElites: GRID_KEYS | ICM_KEYS,
}
EVERY = pytest.mark.parametrize("algorithm", OWN_KEYS, ids=lambda algorithm: algorithm.__name__)
"""For what each algorithm does in a way of its own."""


@pytest.fixture(params=[CuriosityES, MAPElites], ids=lambda algorithm: algorithm.__name__)
def algorithm(request):
    """A search with a center and one with an archive, for what the loop does for all of them."""
    return request.param


class Recorder(BaseCallback):
    """Remembers what was called, and what it could see."""

    def __init__(self, stop_after=None):
        super().__init__()
        self.events, self.timesteps, self.rollouts = [], [], []
        self.stop_after = stop_after

    def _on_training_start(self):
        self.events.append("training start")

    def _on_rollout_start(self):
        self.events.append("rollout start")

    def _on_rollout_end(self):
        self.events.append("rollout end")
        self.rollouts.append(self.locals["rollouts"])

    def _on_step(self):
        self.events.append("step")
        self.timesteps.append(self.num_timesteps)
        return self.n_calls != self.stop_after

    def _on_training_end(self):
        self.events.append("training end")


class TestLearn:
    def test_ends_with_the_generation_that_reaches_the_budget(
        self, algorithm, make_model, make_maze
    ):
        model = make_model(algorithm, make_maze())
        assert model.learn(0) is model
        assert (model.num_timesteps, model.generation) == (0, 0)
        model.learn(GENERATION + 1.0)
        assert (model.num_timesteps, model.generation) == (2 * GENERATION, 2)

    def test_counts_the_steps_of_every_episode(self, algorithm, make_model, make_classic):
        model, recorder = make_model(algorithm, make_classic("CartPole-v1")), Recorder()
        model.learn(200, callback=recorder)
        lengths = [rollouts.lengths for rollouts in recorder.rollouts]
        assert len(np.unique(np.concatenate(lengths))) > 1
        np.testing.assert_array_equal(recorder.timesteps, np.cumsum([x.sum() for x in lengths]))
        assert model.num_timesteps == recorder.timesteps[-1] >= 200 > recorder.timesteps[-2]

    def test_counts_on_or_from_zero(self, algorithm, make_model, make_maze):
        model = make_model(algorithm, make_maze()).learn(GENERATION)
        model.learn(GENERATION, reset_num_timesteps=False)
        assert (model.num_timesteps, model.generation) == (2 * GENERATION, 2)
        model.learn(GENERATION)
        assert (model.num_timesteps, model.generation) == (GENERATION, 3)

    @pytest.mark.parametrize("horizon", HORIZONS)
    def test_remembers_the_best_and_the_first(self, make_model, make_easy_maze, horizon):
        model, recorder = make_model(CanonicalES, make_easy_maze(horizon=horizon)), Recorder()
        assert (model.best_return, model.first_success_timesteps) == (-np.inf, None)
        model.learn(60 * horizon, callback=recorder)
        returns = np.concatenate([rollouts.returns for rollouts in recorder.rollouts])
        lengths = np.concatenate([rollouts.lengths for rollouts in recorder.rollouts])
        assert model.best_return == round(returns.max(), 6) > 0
        first = np.flatnonzero(returns > 0)[0]
        assert model.first_success_timesteps == lengths[: first + 1].sum()
        assert model.first_reward_timesteps == model.first_success_timesteps

    def test_the_first_success_counts_the_timesteps_before(self, make_model, make_easy_maze):
        model = make_model(CanonicalES, make_easy_maze())
        model.num_timesteps = 1000
        model.learn(60 * 64, reset_num_timesteps=False)
        assert model.first_success_timesteps > 1000

    def test_a_bar_counts_timesteps(self, make_model, make_maze, capsys):
        model = make_model(CanonicalES, make_maze())
        model.learn(GENERATION + 100, progress_bar=True)
        shown = capsys.readouterr().err
        assert "400/400" in shown
        assert "coverage=" in shown
        model.learn(GENERATION, reset_num_timesteps=False, progress_bar=True)
        assert "900/900" in capsys.readouterr().err


class TestDeterminism:
    @EVERY
    def test_the_seed_decides(self, algorithm, make_model, make_classic, assert_same_run):
        one, same, other = (
            make_model(algorithm, make_classic("CartPole-v1"), seed=seed).learn(600)
            for seed in (1, 1, 2)
        )
        assert_same_run(one, same)
        assert not np.array_equal(one.policy.vector, other.policy.vector)

    @EVERY
    def test_threads_change_no_bit(self, algorithm, make_model, make_easy_maze, assert_same_run):
        models = []
        for n_threads, n_torch_threads in [(1, 1), (2, 1), (3, 2)]:
            th.set_num_threads(n_torch_threads)
            model = make_model(algorithm, make_easy_maze(), n_threads=n_threads)
            models.append(model.learn(1500))
        assert_same_run(models[0], models[1])
        assert_same_run(models[0], models[2])


class TestPredict:
    def test_the_center_acts_while_there_is_no_reward(self, algorithm, make_model, make_maze):
        model = make_model(algorithm, make_maze())
        for _ in range(2):
            np.testing.assert_array_equal(model.policy.vector, model._center())
            model.learn(GENERATION)
        assert model.best_return == 0.0
        assert model.best_episode_seed is None  # the center's is nobody's episode

    @pytest.mark.parametrize("horizon", HORIZONS)
    def test_the_best_policy_scores_its_best_return_again(
        self, algorithm, make_model, make_easy_maze, horizon
    ):
        make = functools.partial(make_easy_maze, horizon=horizon)
        model = make_model(algorithm, make()).learn(60 * horizon)
        assert model.best_return > 0
        for env in (Monitor(make()), model.get_env()):
            assert evaluate_policy(model, env, n_eval_episodes=2) == (model.best_return, 0.0)
        # Without a Monitor SB3 takes rewards as float32.
        mean, _ = evaluate_policy(model, make(), n_eval_episodes=2, warn=False)
        assert mean == np.float32(model._best.value)
        assert mean == model.best_return or horizon != 64


@pytest.mark.parametrize("later", [False, True])
def test_a_success_that_pays_nothing_is_found_and_acted_with(later, make_model, make_easy_maze):
    model = make_model(CanonicalES, make_easy_maze())
    played, evaluate = [], model.evaluator.evaluate

    def succeed(parameters, seed=None):
        played.append(parameters)
        rollouts = evaluate(parameters, seed)
        success = np.arange(len(parameters)) == (4 if len(played) > later else -1)
        return dataclasses.replace(rollouts, success=success, returns=np.zeros(len(parameters)))

    model.evaluator.evaluate = succeed
    for _ in range(1 + later):
        model.learn(1)
    assert len(played) == 1 + later
    assert model.best_return == 0.0
    np.testing.assert_array_equal(model.policy.vector, played[-1][4])


class TestEnvs:
    @pytest.mark.parametrize(
        "kind", ["id", "classic", "env", "make_vec", "sync", "dummy", "subproc", "monitor"]
    )
    def test_any_kind_trains_and_is_seen_as_a_vec_env(
        self, algorithm, make_model, make_classic, kind
    ):
        make = lambda: gym.make(HARD, horizon=20)  # noqa: E731
        env = {
            "id": lambda: HARD,
            "classic": lambda: make_classic("Pendulum-v1"),
            "env": make,
            "make_vec": lambda: gym.make_vec(HARD, num_envs=2, horizon=20),
            "sync": lambda: SyncVectorEnv([make] * 2),
            "dummy": lambda: DummyVecEnv([make] * 2),
            "subproc": lambda: SubprocVecEnv([make] * 2, start_method="fork"),
            "monitor": lambda: Monitor(make()),
        }[kind]()
        model = make_model(algorithm, env)
        try:
            assert isinstance(model.get_env(), VecEnv)
            model.learn(1)
            assert model.num_timesteps == 6 * {"id": 2000, "classic": 200}.get(kind, 20)
            has_behaviors = env_attribute(model.get_env(), "behavior_space") is not None
            assert (model.coverage is None) == (not has_behaviors)
            assert has_behaviors or kind == "classic"
            assert np.isfinite(evaluate_policy(model, model.get_env(), 1, warn=False)[0])
        finally:
            model.get_env().close()

    @EVERY
    def test_set_env_goes_on_elsewhere(self, algorithm, make_model, make_maze):
        model = make_model(algorithm, make_maze()).learn(GENERATION)
        model.set_env(DummyVecEnv([make_maze] * 3))
        assert model.coverage > 0.0  # the same maze, the same cells
        model._best.value, model._best.has_reward = 0.5, True
        model.set_env("CuriosityMaze-Snake-v0")
        assert model.coverage == 0.0
        assert model.best_return == -np.inf
        np.testing.assert_array_equal(model.policy.vector, model._center())
        model.set_env(make_maze(layout="us", horizon=10))
        model.learn(6 * 10, reset_num_timesteps=False)
        assert model.num_timesteps == GENERATION + 6 * 10
        assert model.get_env().num_envs == 1

    @pytest.mark.parametrize(
        "wrong", [lambda make: VecNormalize(DummyVecEnv([make])), lambda make: "CartPole-v1"]
    )
    def test_a_wrong_env_leaves_the_old_one(self, make_model, make_maze, assert_same_run, wrong):
        model, untouched = (make_model(CanonicalES, make_maze()) for _ in range(2))
        with pytest.raises(ValueError, match=r"VecNormalize|spaces do not match"):
            model.set_env(wrong(make_maze))
        assert_same_run(model.learn(GENERATION), untouched.learn(GENERATION))


WRONG = [
    (CanonicalES, {"population_size": 0, "n_parents": 0, "sigma": 0.0, "learning_rate": 0.0}),
    (CanonicalES, {"population_size": 2.5, "n_parents": 7, "sigma": 1e300, "step": "Canonical"}),
    (CanonicalES, {"mirrored_sampling": "no", "n_threads": 0, "seed": -1, "verbose": -1}),
    (CanonicalES, {"mirrored_sampling": 1, "seed": "1", "verbose": 3, "device": "gpu"}),
    (CanonicalES, {"policy_kwargs": {"activation_fn": None}, "seed": True, "device": 3.5}),
    (CanonicalES, {"verbose": "a", "device": 0, "normalize_observations": "yes"}),
    (CanonicalES, {"verbose": True, "device": None}),
    (MAPElites, {"population_size": 0, "sigma": 0.0}),
    (CMAME, {"restart_interval": 0, "es": "cma", "population_size": 1}),
    (AURORA, {"latent_size": 0, "trajectory_share": 0.0, "archive_size": 0, "batch_size": 0}),
    (AURORA, {"training_interval": 0, "n_epochs": 10**18, "ae_learning_rate": -1.0}),
    (CuriosityES, {"phi": 1.1, "gamma": 1.1, "n_states": 0, "bonus": "ICM", "no_reward": "noise"}),
    (CuriosityES, {"n_transitions": 0, "n_updates": 0, "batch_size": 0, "buffer_size": 0}),
    (CuriosityES, {"bonus_kwargs": [1]}),
    (CuriosityMAPElites, {"tournament_size": 0, "n_kept": 0, "bonus": "none"}),
    (CuriosityMAPElites, {"bonus_kwargs": {"depth": 1}}),
    (NSES, {"k": 0, "behavior": "last"}),
    (NSLC, {"n_parents": 7, "k": 0, "archive_size": 0, "behavior": "x"}),
    (TD3ICM, {"weight": -1.0, "n_updates": 0, "batch_size": 0, "buffer_size": 0, "extrinsic": 1}),
    (TD3ICM, {"bonus": "novelty", "bonus_kwargs": {"depth": 3}, "policy_kwargs": [32]}),
    (TD3ICM, {"learning_rate": -1.0}),
]


@pytest.mark.parametrize(("algorithm", "wrong"), WRONG)
def test_errors_name_the_argument(algorithm, wrong, make_model, make_maze):
    for name, value in wrong.items():
        with pytest.raises(ValueError, match=f"`{name}` m(ust|ay) "):
            make_model(algorithm, make_maze(), **{name: value})


@EVERY
def test_parameters_carry_the_whole_search_over(algorithm, make_model, make_maze, assert_same):
    one = make_model(algorithm, make_maze()).learn(2 * GENERATION)
    other = make_model(algorithm, make_maze(), seed=5)
    other.set_parameters(one.get_parameters())
    for model in (one, other):
        model.learn(2 * GENERATION, reset_num_timesteps=False)
    assert_same(one.get_parameters(), other.get_parameters())


def test_names_that_do_not_match_change_nothing(algorithm, make_model, make_maze, assert_same_run):
    model, untouched = (make_model(algorithm, make_maze()) for _ in range(2))
    policy = {"flat": th.linspace(-1, 1, model.policy.mlp.n_parameters)}
    with pytest.raises(ValueError, match=r"`parameters` must have `\w+"):
        model.set_parameters({"policy": policy})
    with pytest.raises(ValueError, match="`parameters` must not have `_none`"):
        model.set_parameters({"policy": policy, "_none": {}}, exact_match=False)
    with pytest.raises(ValueError, match=r"`policy` must come with `(search|archive)`"):
        model.set_parameters({"policy": policy}, exact_match=False)
    assert_same_run(model, untouched)


class Nowhere(EvolutionaryAlgorithm):
    """Draws policies, with no search that has a state."""

    def _make_search(self, seed):
        pass

    def _ask(self):
        return np.zeros((6, self.policy.mlp.n_parameters), np.float32)

    def _tell(self, rollouts):
        return {}

    def _center(self):
        return np.zeros(self.policy.mlp.n_parameters, np.float32)


def test_an_algorithm_without_a_search_loads_too(make_easy_maze, tmp_path):
    model = Nowhere(make_easy_maze(), seed=0).learn(300)
    model.save(tmp_path / "model")
    loaded = Nowhere.load(tmp_path / "model", make_easy_maze())
    assert loaded.num_timesteps == model.num_timesteps


class TestLogging:
    @EVERY
    def test_keys_are_the_documented_ones(self, algorithm, make_model, make_classic, tmp_path):
        model = make_model(algorithm, make_classic("CartPole-v1"))
        model.set_logger(configure(str(tmp_path), ["json"]))
        model.learn(2 * GENERATION)
        rows = read_log(tmp_path)
        expected = KEYS | OWN_KEYS[algorithm]
        if env_attribute(model.get_env(), "behavior_space") is not None:
            expected = expected | COVERAGE_KEYS
        assert all(row.keys() == expected for row in rows)
        assert rows[-1]["time/total_timesteps"] == model.num_timesteps
        assert rows[-1]["time/generations"] == model.generation == len(rows)
        if "archive/qd_score" in expected:
            stats = model.archive.stats
            logged = rows[-1]["archive/qd_score"], rows[-1]["archive/size"]
            assert logged == (pytest.approx(stats.qd_score), stats.num_elites)
        assert all(np.isfinite(value) for row in rows for value in row.values())

    def test_values_are_those_of_the_rollouts(
        self, algorithm, make_model, make_easy_maze, tmp_path
    ):
        model, recorder = make_model(algorithm, make_easy_maze()), Recorder()
        model.set_logger(configure(str(tmp_path), ["json"]))
        model.learn(2000, callback=recorder)
        for row, rollouts in zip(read_log(tmp_path), recorder.rollouts, strict=True):
            assert row["rollout/ep_rew_mean"] == pytest.approx(rollouts.returns.mean())
            assert row["rollout/ep_rew_max"] == pytest.approx(rollouts.returns.max())
            assert row["rollout/ep_len_mean"] == pytest.approx(rollouts.lengths.mean())
            assert row["rollout/success_rate"] == pytest.approx(rollouts.success.mean())
        assert row["coverage/reachable"] == pytest.approx(model.coverage)

    def test_the_interval_counts_generations(self, make_model, make_maze, tmp_path):
        model = make_model(CanonicalES, make_maze())
        model.set_logger(configure(str(tmp_path), ["json"]))
        model.learn(7 * GENERATION, log_interval=3)
        assert [row["time/generations"] for row in read_log(tmp_path)] == [3, 6]


class TestCallbacks:
    def test_events_come_in_stable_baselines_order(self, make_model, make_maze):
        generation = ["rollout start", "step", "rollout end"]
        for n, recorder in ((2, Recorder()), (9, Recorder(stop_after=2))):
            make_model(CanonicalES, make_maze()).learn(n * GENERATION, callback=recorder)
            assert recorder.events == ["training start", *generation, *generation, "training end"]
            assert recorder.timesteps == [GENERATION, 2 * GENERATION]

    @pytest.mark.parametrize("horizon", HORIZONS)
    def test_evaluation_stops_at_a_threshold(
        self, algorithm, make_model, make_easy_maze, tmp_path, horizon
    ):
        callback = EvalCallback(
            Monitor(make_easy_maze(horizon=horizon)),
            eval_freq=1,
            n_eval_episodes=1,
            callback_on_new_best=StopTrainingOnRewardThreshold(0.1),
            best_model_save_path=str(tmp_path),
            verbose=0,
        )
        model = make_model(algorithm, make_easy_maze(horizon=horizon))
        model.learn(300 * horizon, callback=callback)
        assert model.num_timesteps < 300 * horizon
        assert callback.best_mean_reward == model.best_return > 0.1
        best = algorithm.load(tmp_path / "best_model", env=make_easy_maze(horizon=horizon))
        assert evaluate_policy(best, best.get_env(), 1)[0] == model.best_return


def test_trajectories_are_freed_before_others_come(algorithm, make_model, make_maze):
    class Freed(BaseCallback):
        seen = None

        def _on_rollout_start(self):
            gc.collect()
            deadline = time.monotonic() + 10
            # A pool's threads let go of what they have done a little later.
            while self.seen is not None and self.seen() is not None:
                assert time.monotonic() < deadline, gc.get_referrers(self.seen())
                time.sleep(0.01)
            assert self.n_calls == 0 or self.locals["rollouts"].observations is None

        def _on_step(self):
            self.seen = weakref.ref(self.locals["rollouts"].observations)
            return True

    callback = Freed()
    make_model(algorithm, make_maze()).learn(3 * GENERATION, callback=callback)
    assert callback.n_calls == 3
    assert callback.locals["rollouts"].observations is callback.seen()  # of the last they stay


class Halved(Evaluator):
    """Evaluates as another does, and pays half."""

    def __init__(self, evaluator):
        self._evaluator = evaluator
        self.n_parameters = evaluator.n_parameters
        self.n_calls = 0

    def evaluate(self, parameters, seed=None):
        self.n_calls += 1
        rollouts = self._evaluator.evaluate(parameters, seed)
        return dataclasses.replace(rollouts, returns=rollouts.returns / 2.0)


class TestEvaluator:
    def test_a_given_one_evaluates(self, algorithm, make_model, make_easy_maze):
        plain = make_model(algorithm, make_easy_maze())
        halved = Halved(plain.evaluator)
        model = make_model(algorithm, make_easy_maze(), evaluator=halved)
        assert model.evaluator is halved
        plain.learn(GENERATION)
        model.learn(GENERATION)
        assert halved.n_calls == model.generation
        assert model._best.value == plain._best.value / 2.0

    def test_it_is_of_as_many_parameters(self, make_model, make_easy_maze):
        other = Halved(make_model(CanonicalES, make_easy_maze()).evaluator)
        other.n_parameters += 1
        for wrong in (other, 3, "fast"):
            with pytest.raises(ValueError, match="`evaluator` must be"):
                make_model(CanonicalES, make_easy_maze(), evaluator=wrong)

    def test_another_env_needs_another(self, make_model, make_easy_maze, make_maze):
        halved = Halved(make_model(CanonicalES, make_easy_maze()).evaluator)
        model = make_model(CanonicalES, make_easy_maze(), evaluator=halved)
        with pytest.raises(ValueError, match="`env` must be like the one before"):
            model.set_env(make_maze())
        model.set_env(make_easy_maze())
        assert model.evaluator is halved

    def test_load_takes_it_again(self, make_model, make_easy_maze, tmp_path):
        halved = Halved(make_model(CanonicalES, make_easy_maze()).evaluator)
        make_model(CanonicalES, make_easy_maze(), evaluator=halved).save(tmp_path / "model")
        with pytest.raises(ValueError, match="`evaluator` must be given to `load`"):
            CanonicalES.load(tmp_path / "model", make_easy_maze())
        for evaluator, kind in ((halved, Halved), ("auto", MazeEvaluator)):
            loaded = CanonicalES.load(tmp_path / "model", make_easy_maze(), evaluator=evaluator)
            assert type(loaded.evaluator) is kind
        assert CanonicalES.load(tmp_path / "model").evaluator is None  # to predict alone

    @pytest.mark.parametrize("visited", [None, [9, 9]])
    def test_it_may_count_visited_cells(self, make_model, make_maze, visited):
        class Own(Halved):
            def evaluate(self, parameters, seed=None):
                return dataclasses.replace(super().evaluate(parameters, seed), visited=visited)

        own = Own(make_model(CanonicalES, make_maze()).evaluator)
        model = make_model(CanonicalES, make_maze(), evaluator=own)
        shares = model.learn(1).coverage_shares
        assert (shares["visited"] == shares["reachable"]) == (visited is None)

    def test_as_many_episodes_as_policies(self, make_model, make_easy_maze):
        class Lazy(Halved):
            def evaluate(self, parameters, seed=None):
                return super().evaluate(parameters[:3], seed)

        lazy = Lazy(make_model(CanonicalES, make_easy_maze()).evaluator)
        model = make_model(CanonicalES, make_easy_maze(), evaluator=lazy)
        with pytest.raises(ValueError, match="`evaluator` must give one episode of each of 6"):
            model.learn(GENERATION)
