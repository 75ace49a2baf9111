"""Rewarding policies, played again and projected."""

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.colors import to_hex

from curiosity_algos import NSES, MAPElites
from curiosity_algos.evaluation import evaluator
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.experiments.figures import projection
from curiosity_algos.experiments.figures.projection import (
    N_STATES,
    Projection,
    last_states,
    project,
    project_rewarding,
    replay_rewarding,
    show_projection,
)
from curiosity_algos.experiments.labels import COLORS
from curiosity_algos.experiments.run import Run
from curiosity_algos.experiments.run_folder import RunFolder


@pytest.fixture(scope="module")
def run(make_runs):
    return make_runs(MAPElites, seeds=(0,))[0]


def kept(run):
    return np.load(RunFolder(run).checkpoint / "rewarding.npz")


def test_policies_that_are_played_again_do_what_they_did(run):
    rewarding = replay_rewarding(Run(run))
    stored = kept(run)["return"]
    assert len(np.unique(kept(run)["episode_seed"])) > 2
    assert len(stored) > 10
    np.testing.assert_allclose(rewarding.returns, stored, atol=5e-7)  # kept with 6 digits
    assert rewarding.states.shape == (len(stored), N_STATES, 36)
    # The last state is at the goal: 91.5 from the middle.
    x, y = 100.0 + 100.0 * rewarding.states[:, -1, :2].T.astype(float)
    assert (np.hypot(x - 100.0, y - 100.0) <= 91.51).all()


def test_of_many_policies_some_are_played(run, monkeypatch):
    monkeypatch.setattr(projection, "MOST_POLICIES", 5)
    monkeypatch.setattr(evaluator, "BATCH", 2)
    some = replay_rewarding(Run(run))
    assert len(some.returns) == 5
    assert set(some.returns.round(6)) <= set(kept(run)["return"])


def test_the_first_state_stands_before_a_short_episode():
    observations = np.arange(2 * 6 * 1, dtype=np.float32).reshape(2, 6, 1)
    rollouts = Rollouts(
        returns=np.zeros(2),
        lengths=np.array([2, 5]),
        success=np.ones(2, dtype=bool),
        terminated=np.ones(2, dtype=bool),
        behaviors=np.empty((2, 0)),
        final_observations=observations[:, -1],
        observations=observations,
        actions=np.zeros((2, 5, 1), dtype=np.float32),
    )
    last = last_states(rollouts, 4)
    assert last[:, :, 0].tolist() == [[0.0, 0.0, 1.0, 2.0], [8.0, 9.0, 10.0, 11.0]]


def test_components_are_those_of_the_singular_values():
    rng = np.random.default_rng(0)
    states = rng.normal(size=(40, 3, 5)) * np.array([9.0, 5.0, 1.0, 1.0, 1.0])
    scores, shares = project(states.astype(np.float32))
    flat = states.reshape(40, -1)
    u, s, _ = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    for i in range(2):
        sign = np.sign(u[0, i] * scores[0, i])
        np.testing.assert_allclose(scores[:, i], sign * u[:, i] * s[i], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(shares, s[:2] ** 2 / (s**2).sum(), rtol=1e-4)


def test_policies_of_all_runs_are_projected_together(make_runs):
    runs = {
        "MAPElites": make_runs(MAPElites, seeds=(0, 1)),
        "NSES": make_runs(NSES, seeds=(0,), n_parents=4),
    }
    played = {name: [replay_rewarding(Run(run)) for run in each] for name, each in runs.items()}
    numbers = [sum(len(each.returns) for each in of_one) for of_one in played.values()]
    assert min(numbers) > 0
    projection = project_rewarding(played)
    assert projection.algorithms == ("MAPElites", "NSES")
    assert np.bincount(projection.owners).tolist() == numbers
    pooled = [each for of_one in played.values() for each in of_one]
    scores, shares = project(np.concatenate([each.states for each in pooled]))
    np.testing.assert_allclose(projection.scores, scores)
    np.testing.assert_allclose(projection.shares, shares)
    np.testing.assert_array_equal(
        projection.returns, np.concatenate([each.returns for each in pooled])
    )


def test_both_panels_show_every_policy(has_ink):
    rng = np.random.default_rng(0)
    projection = Projection(
        algorithms=("CuriosityES", "CMAME", "MAPElites"),
        owners=np.repeat([0, 2], [30, 8]),
        scores=rng.normal(size=(38, 2)),
        returns=rng.random(38),
        shares=np.array([0.5, 0.2]),
    )
    figure = show_projection(projection, "US")
    left, right, bar = figure.axes
    assert bar.get_ylabel() == "return"
    dots = [
        next(each for each in ax.collections if isinstance(each, PathCollection))
        for ax in (left, right)
    ]
    np.testing.assert_array_equal(*(each.get_offsets() for each in dots))
    assert left.get_xlabel() == "component 1 (50% of the variance)"
    colors = [COLORS["CuriosityES"]] * 30 + [COLORS["MAPElites"]] * 8
    expected = {
        (*score, total, color.lower())
        for score, total, color in zip(
            projection.scores.tolist(), projection.returns, colors, strict=True
        )
    }
    faces = [to_hex(color) for color in dots[0].get_facecolors()]
    shown = zip(dots[0].get_offsets().tolist(), dots[1].get_array(), faces, strict=True)
    assert {(*score, total, color) for score, total, color in shown} == expected
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["CuriosityES (30)", "CMAME (no reward)", "MAPElites (8)"]
    assert has_ink(figure, left)
    assert has_ink(figure, right)


def test_an_environment_of_strangers_is_not_made(make_runs):
    (run,) = make_runs(MAPElites, seeds=(7,))
    described = RunFolder(run).describe()
    described["env_spec"]["entry_point"] = "somebody:Else"
    RunFolder(run).begin(described)
    with pytest.raises(ValueError, match="`trust` must be given"):
        replay_rewarding(Run(run))


def test_damaged_policies_are_told(make_runs):
    (run,) = make_runs(NSES, seeds=(0,), timesteps=60, n_parents=2, k=3)
    (RunFolder(run).checkpoint / "rewarding.npz").write_bytes(b"PK\x03\x04")
    with pytest.raises(ValueError, match=r"rewarding\.npz is damaged"):
        replay_rewarding(Run(run))


def test_there_must_be_something_to_project(make_runs):
    (run,) = make_runs(NSES, seeds=(0,), timesteps=60, goal_radius=2.0, n_parents=2)
    none = replay_rewarding(Run(run))
    assert none.states.shape == (0, N_STATES, 36)
    with pytest.raises(ValueError, match="`runs` must have 3 rewarding policies, they have"):
        project_rewarding({"NSES": [none]})
