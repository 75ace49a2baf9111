"""What every algorithm with an archive does."""

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.callbacks import BaseCallback

from curiosity_algos import AURORA, CMAME, NSLC, CuriosityMAPElites, MAPElites
from curiosity_algos.evaluation.policies import act

WITH_ARCHIVES = [NSLC, MAPElites, CMAME, AURORA, CuriosityMAPElites]


class Population(BaseCallback):
    """Collects what was played."""

    def __init__(self):
        super().__init__()
        self.rollouts = []

    def _on_rollout_end(self):
        self.rollouts.append(self.locals["rollouts"])

    def _on_step(self):
        return True


@pytest.fixture(params=WITH_ARCHIVES, ids=lambda algorithm: algorithm.__name__)
def algorithm(request):
    return request.param


@pytest.mark.parametrize("horizon", [64, 2000])
def test_elites_reproduce(algorithm, make_model, make_easy_maze, horizon):
    model = make_model(algorithm, make_easy_maze(horizon=horizon)).learn(47 * horizon)
    report = model.archive.verify(make_easy_maze(horizon=horizon))
    assert report.share == 1.0
    assert len(model.archive) > 1
    np.testing.assert_array_equal(report.objective, model.archive.data("objective"))


def test_elites_of_random_starts_reproduce_with_their_seeds(algorithm, make_model, make_classic):
    make = lambda: make_classic("Pendulum-v1", max_episode_steps=30)  # noqa: E731
    model = make_model(algorithm, make()).learn(1000)
    assert len(np.unique(model.archive.data("seed"))) > 1
    assert model.archive.verify(make()).share == 1.0


@pytest.mark.parametrize("horizon", [64, 2000])
def test_elites_are_of_the_individuals(algorithm, make_model, make_easy_maze, horizon):
    callback = Population()
    model = make_model(algorithm, make_easy_maze(horizon=horizon))
    model.learn(47 * horizon, callback=callback)
    played = np.concatenate([rollouts.behaviors for rollouts in callback.rollouts])
    returns = np.concatenate([rollouts.returns for rollouts in callback.rollouts])
    rows = {(*behavior, value) for behavior, value in zip(played, returns, strict=True)}
    elites = zip(model.archive.behaviors, model.archive.data("objective"), strict=True)
    assert {(*behavior, value) for behavior, value in elites} <= rows
    assert model.archive.stats.obj_max == returns.max()
    assert model.best_return == round(returns.max(), 6)


def test_a_niche_acts_with_its_nearest_elite(algorithm, make_model, make_easy_maze):
    env = make_easy_maze()
    model = make_model(algorithm, env).learn(3000)
    observation, _ = env.reset()
    acting = model.policy.vector.copy()
    _, slots = np.unique(model.archive.behaviors, axis=0, return_index=True)
    for slot in slots:
        niche = model.archive.behaviors[slot]
        elite = model.archive.data("solution")[slot]
        expected = act(model.policy.mlp, elite[None], observation[None])[0]
        np.testing.assert_array_equal(model.predict(observation, niche=niche)[0], expected)
    np.testing.assert_array_equal(model.policy.vector, acting)


def test_a_niche_must_be_a_behavior(algorithm, make_model, make_maze):
    env = make_maze()
    model = make_model(algorithm, env)
    observation, _ = env.reset()
    with pytest.raises(ValueError, match="`niche` needs an archive with elites"):
        model.predict(observation, niche=np.zeros(4))
    model.learn(1)
    for niche in (np.zeros(3), np.full(4, np.nan)):
        with pytest.raises(ValueError, match="`niche` must be finite of shape"):
            model.predict(observation, niche=niche)


def test_the_history_is_the_archives(algorithm, make_model, make_easy_maze):
    callback = Population()
    model = make_model(algorithm, make_easy_maze()).learn(2000, callback=callback)
    timesteps = np.cumsum([rollouts.timesteps for rollouts in callback.rollouts])
    np.testing.assert_array_equal(model.history["timesteps"], timesteps)
    best = np.maximum.accumulate([rollouts.returns.max() for rollouts in callback.rollouts])
    np.testing.assert_array_equal(model.history["best"], best)
    stats = model.archive.stats
    assert model.history["size"][-1] == len(model.archive) == stats.num_elites
    assert model.history["qd_score"][-1] == stats.qd_score
    assert model.history["coverage"][-1] == stats.coverage
    assert len(model.history) == model.generation


def test_another_maze_starts_anew(algorithm, make_model, make_maze):
    model = make_model(algorithm, make_maze()).learn(6 * 50)
    model.set_env(make_maze())
    assert len(model.archive) > 0
    emitted = model._ask()
    model.set_env(make_maze(layout="snake"))
    assert len(model.archive) == len(model.history) == 0
    assert not np.array_equal(model._ask(), emitted)
    model.learn(6 * 50)
    assert model.archive.verify(make_maze(layout="snake")).share == 1.0


def test_a_failed_generation_can_be_taken_again(algorithm, make_model, make_easy_maze):
    model = make_model(algorithm, make_easy_maze())
    evaluate = model.evaluator.evaluate

    def fail(parameters, seed):
        raise OSError("the simulator is gone")

    model.evaluator.evaluate = fail
    with pytest.raises(OSError, match="gone"):
        model.learn(1)
    model.evaluator.evaluate = evaluate
    assert len(model.learn(2000).archive) > 0


@pytest.mark.parametrize(
    ("algorithm", "what"),
    [(each, "behaviors") for each in WITH_ARCHIVES]
    + [(each, "observations") for each in (NSLC, AURORA, CuriosityMAPElites)],
)
def test_what_is_not_finite_enters_no_archive(algorithm, make_model, make_easy_maze, what):
    model = make_model(algorithm, make_easy_maze())
    evaluate = model.evaluator.evaluate

    def spoil(parameters, seed):
        rollouts = evaluate(parameters, seed)
        for name in ("observations", "final_observations") if what == "observations" else [what]:
            getattr(rollouts, name)[1] = np.inf
        return rollouts

    model.evaluator.evaluate = spoil
    with pytest.raises(ValueError, match="`env` must give finite"):
        model.learn(1)
    assert len(model.archive) == model.generation == 0


def test_settings_of_a_saved_model_stay(algorithm, make_model, make_easy_maze, tmp_path):
    make_model(algorithm, make_easy_maze()).learn(500).save(tmp_path / "model")
    for name, value in [("sigma", 0.01), ("population_size", 3)]:
        with pytest.raises(ValueError, match=f"`{name}` must be left as it was saved"):
            algorithm.load(tmp_path / "model", **{name: value})
        with pytest.raises(ValueError, match=f"`{name}` must be left as it was saved"):
            algorithm.load(tmp_path / "model", custom_objects={name: value})
    loaded = algorithm.load(tmp_path / "model", device="cpu", n_threads=1, verbose=0)
    assert (loaded.n_threads, loaded.sigma) == (1, make_model(algorithm, make_easy_maze()).sigma)


def test_archives_save_and_load(algorithm, make_model, make_easy_maze, tmp_path):
    model = make_model(algorithm, make_easy_maze()).learn(2000)
    model.archive.save(tmp_path / "archive")
    loaded = type(model.archive).load(tmp_path / "archive.npz")
    assert loaded.net_arch == [4]
    assert loaded.verify(make_easy_maze()).share == 1.0
    for name, values in model.archive.data().items():
        np.testing.assert_array_equal(loaded.data(name), values)


def test_mutations_have_the_size_of_sigma(algorithm, make_model, make_maze):
    asked = make_model(algorithm, make_maze(), population_size=50, sigma=0.25)._ask()
    assert asked.dtype == np.float32
    assert asked.std(axis=0).mean() == pytest.approx(0.25, rel=0.1)


@pytest.mark.parametrize("algorithm", [MAPElites, CMAME, CuriosityMAPElites])
def test_an_env_without_behaviors_leaves_the_old_one(algorithm, make_model, make_classic):
    plain, behaving = gym.make("Pendulum-v1"), make_classic("Pendulum-v1")
    model = make_model(algorithm, behaving).learn(1200)
    n_elites, env = len(model.archive), model.get_env()
    with pytest.raises(ValueError, match="`env` must have a bounded `behavior_space`"):
        model.set_env(plain)
    assert model.get_env() is env
    assert len(model.archive) == n_elites


def test_curiosity_goes_on_in_another_maze(make_model, make_maze):
    model = make_model(CuriosityMAPElites, make_maze()).learn(600)
    size = model._motivation.buffer.size
    model.set_env(make_maze(layout="snake"))
    assert model._motivation.buffer.size == size > 0


@pytest.mark.parametrize(("name", "value"), [("population_size", 0), ("sigma", 0.0)])
def test_errors_name_the_argument(algorithm, make_model, make_maze, name, value):
    with pytest.raises(ValueError, match=f"`{name}` must be"):
        make_model(algorithm, make_maze(), **{name: value})
