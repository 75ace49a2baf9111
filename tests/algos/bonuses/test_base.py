import copy

import numpy as np
import pytest
import torch as th
from gymnasium import spaces

from curiosity_algos.bonuses.make import BONUSES

FLAT = spaces.Box(-1, 1, (6,))
CHANNELS_FIRST, CHANNELS_LAST = (
    spaces.Box(0, 255, shape, np.uint8) for shape in ((3, 36, 40), (36, 40, 3))
)
SPACES = {
    "flat-box": (FLAT, spaces.Box(-1, 1, (2,))),
    "flat-discrete": (FLAT, spaces.Discrete(3)),
    "images-first": (CHANNELS_FIRST, spaces.Discrete(3)),
    "images-last": (CHANNELS_LAST, spaces.Box(-1, 1, (2,))),
}

CASES = [
    *[(name, "flat-box") for name in BONUSES],
    ("icm", "flat-discrete"),
    ("e3b", "flat-discrete"),
    ("ngu", "flat-discrete"),
    ("disagreement", "flat-discrete"),
    ("disagreement", "images-first"),
    ("etd", "images-first"),
    ("ramp", "images-last"),
    ("noveld", "images-last"),
    ("apt", "images-last"),
    ("rnd", "images-first"),
]
"""Each bonus, and each kind of spaces; all of both only where a test says so."""

pytestmark = pytest.mark.parametrize(("name", "kind"), CASES)


def make_bonus(name, kind, **changes):
    settings = {"n_features": 4, "hidden": 8, "seed": 0, "device": "cpu"}
    return BONUSES[name](*SPACES[kind], **(settings | changes))


def make_batch(kind, n=20, seed=0):
    """Observations, actions and next observations of a trajectory."""
    rng = np.random.default_rng(seed)
    observation_space, action_space = SPACES[kind]
    if observation_space is FLAT:
        observations = rng.normal(0, 1, (n + 1, 6)).astype(np.float32)
    else:
        observations = rng.integers(0, 256, (n + 1, *observation_space.shape), np.uint8)
    actions = rng.uniform(-1, 1, (n, 2)).astype(np.float32)
    if isinstance(action_space, spaces.Discrete):
        actions = rng.integers(0, 3, n)
    return observations[:-1], actions, observations[1:]


def score(bonus, batch):
    """Of each transition; as the first of an episode, where it asks for that."""
    return (bonus.episodes(len(batch[0])) or bonus).score(*batch)


def tensors(batch):
    return [th.from_numpy(part) for part in batch]


def test_scores_are_of_each_transition(name, kind):
    bonus, (before, actions, after) = make_bonus(name, kind), make_batch(kind)
    bonus.observe(th.from_numpy(before))
    scores = score(bonus, (before, actions, after))
    assert scores.shape == (20,)
    assert scores.dtype == np.float32
    assert (scores >= 0).all() or name == "ramp"  # whose steps may lead back
    assert (scores != 0).mean() > 0.5
    some = score(bonus, (before[4:7], actions[4:7], after[4:7]))
    np.testing.assert_allclose(some, scores[4:7], rtol=1e-3)


def test_a_trajectory_scores_like_its_pairs(name, kind):
    bonus, (before, actions, after) = make_bonus(name, kind), make_batch(kind)
    trajectory = np.concatenate([before, after[-1:]])
    scores, scorer = [], bonus.episodes(1) or bonus
    for i in range(len(actions)):
        step = (each[i : i + 1] for each in (trajectory[:-1], actions, trajectory[1:]))
        scores.append(scorer.score(*step)[0])
    np.testing.assert_allclose(
        bonus.score_trajectory(trajectory, actions), scores, rtol=1e-4, atol=1e-6
    )


def test_seeds_decide_and_torchs_own_draws_stay(name, kind):
    before = th.get_rng_state()
    one, same, other = (make_bonus(name, kind, seed=seed) for seed in (1, 1, 2))
    assert th.equal(before, th.get_rng_state())
    batch = make_batch(kind)
    for bonus in (one, same, other):
        bonus.observe(th.from_numpy(batch[0]))
    episode = np.concatenate([batch[0], batch[2][-1:]]), batch[1]
    scores = [bonus.score_trajectory(*episode) for bonus in (one, same, other)]
    np.testing.assert_array_equal(scores[0], scores[1])
    assert not np.array_equal(scores[0], scores[2])


def test_training_lowers_the_loss(name, kind):
    bonus, batch = make_bonus(name, kind), tensors(make_batch(kind))
    bonus.observe(batch[0] if name != "ramp" else batch[2][-1:])  # it leads to what comes last
    first = bonus.update(*batch)
    for _ in range(100 if bonus.images else 400):
        last = bonus.update(*batch)
    assert first.keys() == last.keys()
    assert last["loss"] < 0.9 * first["loss"]


def test_a_state_of_another_bonus_is_refused(name, kind, assert_same):
    bonus = make_bonus(name, kind)
    before = bonus.state_dict()
    others = [make_bonus(other, kind) for other in BONUSES if other != name]
    for other in [*others, make_bonus(name, kind, n_features=5)]:
        with pytest.raises(ValueError, match="must"):
            bonus.load_state_dict(other.state_dict())
    assert_same(bonus.state_dict(), before)


def test_observations_of_another_shape_are_refused(name, kind):
    bonus, (before, actions, after) = make_bonus(name, kind), make_batch(kind)
    with pytest.raises(ValueError, match="`observations` must have shape"):
        score(bonus, (before[..., None], actions, after[..., None]))


def test_a_state_belongs_to_nobody(name, kind, assert_same):
    one, other = make_bonus(name, kind, seed=0), make_bonus(name, kind, seed=1)
    batch = tensors(make_batch(kind))
    one.update(*batch)
    state = one.state_dict()
    kept = copy.deepcopy(state)
    other.load_state_dict(state)
    for bonus in (one, other):
        bonus.update(*batch)
    assert_same(state, kept)


def test_observations_enter_the_statistics_only_if_normalized(name, kind):
    observations = th.from_numpy(make_batch(kind)[0])
    for normalize in (True, False):
        bonus = make_bonus(name, kind, normalize=normalize)
        before = bonus.inputs(observations)
        bonus.observe(observations[:10] // 3)
        bonus.update(*tensors(make_batch(kind)))
        assert th.equal(before, bonus.inputs(observations)) is not normalize
