import copy

import numpy as np
import pytest

from curiosity_algos import NSLC
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.archives.verify import verify

FINAL, LEARNED = {"behavior": "final"}, {"behavior": "learned"}


@pytest.mark.parametrize("behavior", ["final", "state", "learned"])
def test_elites_are_told_apart_by_their_behaviors(make_model, make_easy_maze, behavior):
    model = make_model(NSLC, make_easy_maze(), behavior=behavior).learn(4000)
    size = {"final": 4, "state": model.observation_space.shape[0], "learned": 8}[behavior]
    assert model.archive.data("measures").shape == (len(model.archive), size)
    assert model.archive.data("behavior").shape == (len(model.archive), 4)
    assert 20 <= len(model.archive) <= 22
    assert model.archive.threshold > 0.0


def test_elites_are_measured_anew_as_the_encoder_learns(make_model, make_easy_maze):
    model = make_model(NSLC, make_easy_maze(), **LEARNED)
    untrained = copy.deepcopy(model._encoder)
    elites = model.learn(4000).archive.data()
    n_generations = len(set(elites["seed"]))
    assert n_generations > 1  # the encoder has learned since the first of them
    anew = model._encoder.of(elites["final_observation"])
    assert not np.allclose(untrained.of(elites["final_observation"]), anew, atol=1e-2)
    np.testing.assert_allclose(elites["measures"], anew, rtol=1e-4, atol=1e-5)


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
