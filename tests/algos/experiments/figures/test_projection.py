"""Rewarding policies, played again and projected."""

import numpy as np
import pytest
from matplotlib.colors import to_hex

from curiosity_algos import NSES, MAPElites
from curiosity_algos.evaluation import evaluator
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.experiments.figures import projection
from curiosity_algos.experiments.figures.projection import (
    N_STATES,
    Projection,
    Rewarding,
    last_states,
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


def stored(run):
    return np.load(RunFolder(run).checkpoint / "rewarding.npz")


def test_policies_that_are_played_again_do_what_they_did(run, monkeypatch):
    rewarding, returns = replay_rewarding(Run(run)), stored(run)["return"]
    assert len(np.unique(stored(run)["episode_seed"])) > 2
    assert len(returns) > 10
    np.testing.assert_allclose(rewarding.returns, returns, atol=5e-7)  # stored with 6 digits
    assert rewarding.states.shape == (len(returns), N_STATES, 36)
    # The last state is at the goal: 91.5 from the middle.
    x, y = 100.0 + 100.0 * rewarding.states[:, -1, :2].T.astype(float)
    assert (np.hypot(x - 100.0, y - 100.0) <= 91.51).all()
    monkeypatch.setattr(projection, "MOST_POLICIES", 5)
    monkeypatch.setattr(evaluator, "BATCH", 2)
    some = replay_rewarding(Run(run))
    assert len(some.returns) == 5
    assert set(some.returns) <= set(rewarding.returns)


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


def test_policies_of_all_runs_are_projected_together():
    """On the singular vectors of their states."""
    rng = np.random.default_rng(0)
    states = rng.normal(size=(40, 3, 5)) * np.array([9.0, 5.0, 1.0, 1.0, 1.0])
    parts = np.split(states.astype(np.float32), [10, 25])
    returns = [rng.random(len(part)) for part in parts]
    one, other, third = map(Rewarding, parts, returns)
    found = project_rewarding({"NSES": [one, other], "CMAME": [], "NSLC": [third]})
    assert found.algorithms == ("NSES", "CMAME", "NSLC")
    assert found.owners.tolist() == [0] * 25 + [2] * 15
    np.testing.assert_array_equal(found.returns, np.concatenate(returns))
    flat = states.reshape(40, -1)
    u, s, _ = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    for i in range(2):
        sign = np.sign(u[0, i] * found.scores[0, i])
        np.testing.assert_allclose(found.scores[:, i], sign * u[:, i] * s[i], rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(found.shares, s[:2] ** 2 / (s**2).sum(), rtol=1e-4)


def test_both_panels_show_every_policy(has_ink):
    rng = np.random.default_rng(0)
    shown = Projection(
        algorithms=("CuriosityES", "CMAME", "MAPElites"),
        owners=np.repeat([0, 2], [30, 8]),
        scores=rng.normal(size=(38, 2)),
        returns=rng.random(38),
        shares=np.array([0.5, 0.2]),
    )
    figure = show_projection(shown, "US")
    left, right, bar = figure.axes
    assert bar.get_ylabel() == "return"
    assert left.get_xlabel() == "component 1 (50% of the variance)"
    dots = [ax.collections[0] for ax in (left, right)]
    np.testing.assert_array_equal(*(each.get_offsets() for each in dots))
    colors = [COLORS["CuriosityES"]] * 30 + [COLORS["MAPElites"]] * 8
    expected = zip(shown.scores.tolist(), shown.returns, map(str.lower, colors), strict=True)
    faces = [to_hex(color) for color in dots[0].get_facecolors()]
    drawn = zip(dots[0].get_offsets().tolist(), dots[1].get_array(), faces, strict=True)
    assert sorted(drawn) == sorted(expected)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["CuriosityES (30)", "CMAME (no reward)", "MAPElites (8)"]
    assert has_ink(figure, left, right)


def test_an_environment_of_strangers_is_not_made(make_runs):
    (run,) = make_runs(MAPElites, seeds=(7,), timesteps=60)
    described = RunFolder(run).describe()
    described["env_spec"]["entry_point"] = "somebody:Else"
    RunFolder(run).begin(described)
    with pytest.raises(ValueError, match="`trust` must be given"):
        replay_rewarding(Run(run))


def test_there_must_be_something_to_project(make_runs):
    (run,) = make_runs(NSES, seeds=(0,), timesteps=60, goal_radius=2.0, n_parents=2)
    none = replay_rewarding(Run(run))
    assert none.states.shape == (0, N_STATES, 36)
    with pytest.raises(ValueError, match="`runs` must have 3 rewarding policies, they have"):
        project_rewarding({"NSES": [none]})
    (RunFolder(run).checkpoint / "rewarding.npz").write_bytes(b"PK\x03\x04")
    with pytest.raises(ValueError, match=r"rewarding\.npz is damaged"):
        replay_rewarding(Run(run))
