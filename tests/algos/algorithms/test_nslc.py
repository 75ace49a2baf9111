import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from padded_rollouts import rollouts_of

from curiosity_algos import NSLC
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.archives.verify import verify

FINAL, LEARNED = {"behavior": "final"}, {"behavior": "learned"}


def front(scores):
    """Indices that no other dominates, from the definition."""
    return {
        i
        for i, one in enumerate(scores)
        if not any((other >= one).all() and (other > one).any() for other in scores)
    }


def test_parents_are_the_best_in_novelty_and_local_competition(make_model, make_easy_maze):
    model = make_model(NSLC, make_easy_maze(), **FINAL, population_size=20, n_parents=5)
    told = []
    add = model.archive.add
    model.archive.add = lambda *args, **kwargs: told.append(add(*args, **kwargs)) or told[-1]
    for _ in range(6):
        asked = model._ask().copy()
        rollouts = model.evaluator.evaluate(asked, 0)
        model._tell(rollouts)
        info = told[-1]
        scores = np.stack([info["novelty"], info["local_competition"]], axis=1)
        chosen = {
            i
            for parent in model._emitters.emitters[0]._parents
            for i in np.flatnonzero((asked == parent).all(axis=1))
        }
        best = front(scores)
        assert len(chosen) == 5
        assert best <= chosen or chosen <= best
    assert model.archive.stats.obj_max > 0


@pytest.mark.parametrize("behavior", ["final", "state", "learned"])
def test_elites_are_told_apart_by_their_behaviors(make_model, make_easy_maze, behavior):
    model = make_model(NSLC, make_easy_maze(), behavior=behavior).learn(4000)
    size = {"final": 4, "state": model.observation_space.shape[0], "learned": 8}[behavior]
    assert model.archive.data("measures").shape == (len(model.archive), size)
    assert model.archive.data("behavior").shape == (len(model.archive), 4)
    assert 20 <= len(model.archive) <= 22
    assert model.archive.threshold > 0.0


def test_elites_are_measured_anew_as_the_encoder_learns(make_model, make_easy_maze):
    model = make_model(NSLC, make_easy_maze(), **LEARNED).learn(4000)
    elites = model.archive.data()
    n_generations = len(set(elites["seed"]))
    assert n_generations > 1  # the encoder has learned since the first of them
    anew = model._encoder.of(elites["final_observation"])
    np.testing.assert_allclose(elites["measures"], anew, rtol=1e-4, atol=1e-5)


class Line(gym.Env):
    """A walk along a line that goes one way; the other two entries are noise."""

    observation_space = spaces.Box(-np.inf, np.inf, (3,))
    action_space = spaces.Box(-1.0, 1.0, (1,))


def walks(rng, n=20, n_steps=100):
    observations = rng.normal(size=(n, n_steps + 1, 3)).astype(np.float32)
    speeds = rng.uniform(0.5, 1.5, (n, 1))
    observations[..., 0] = speeds * np.arange(n_steps + 1) - 50.0
    return rollouts_of(observations, np.full(n, n_steps))


def test_what_is_far_in_time_is_far_and_noise_is_not():
    model = NSLC(Line(), behavior="learned", seed=0, n_threads=1)
    rng = np.random.default_rng(0)
    for _ in range(20):
        losses = model._encoder.learn(walks(rng), model.archive, "final_observation")
    assert losses.keys() == {"apt/loss"}
    places = np.zeros((3, 3))
    places[:, 0] = -40.0, 0.0, 40.0
    here, middle, there = model._encoder.of(places)
    noise = model._encoder.of(np.add(places[:1], [0.0, 1.0, -1.0]))[0]
    assert here.shape == (8,)
    near, far = np.linalg.norm(here - middle), np.linalg.norm(here - there)
    assert far > 1.1 * near  # 1.27, and 1.05 to 1.75 with other seeds
    assert near > 20.0 * np.linalg.norm(here - noise)


def test_a_run_with_learned_behaviors_goes_on(
    make_model, make_easy_maze, assert_same_run, tmp_path
):
    """On another number of threads, too."""
    whole, part = (
        make_model(NSLC, make_easy_maze(), **LEARNED, n_threads=n).learn(1000) for n in (2, 1)
    )
    part.save(tmp_path / "model")
    resumed = NSLC.load(tmp_path / "model", env=make_easy_maze())
    for model in (whole, resumed):
        model.learn(1000, reset_num_timesteps=False)
    assert_same_run(whole, resumed)
    assert verify(resumed.archive, make_easy_maze()).share == 1.0


def test_learned_behaviors_begin_with_an_empty_archive(make_model, make_easy_maze):
    archive = make_model(NSLC, make_easy_maze(), **LEARNED).learn(500).archive
    with pytest.raises(ValueError, match="`archive` must be empty"):
        make_model(NSLC, make_easy_maze(), **LEARNED, archive=archive)


def test_an_archive_tells_novelty(make_model, make_easy_maze):
    keywords = {"solution_dim": make_model(NSLC, make_easy_maze()).policy.mlp.n_parameters}
    own = UnstructuredArchive(**keywords, measure_dim=4, target_size=9, k_neighbors=None)
    with pytest.raises(ValueError, match="`archive` must be made with `k_neighbors`"):
        make_model(NSLC, make_easy_maze(), **FINAL, archive=own)
