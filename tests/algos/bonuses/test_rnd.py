import copy

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from observations import make_observations

from curiosity_algos.bonuses.rnd import RND

SPACE = spaces.Box(-1, 1, (6,)), spaces.Discrete(3)


def make_rnd(**changes):
    settings = {"n_features": 4, "hidden": 8, "seed": 0, "device": "cpu"}
    return RND(*SPACE, **(settings | changes))


def test_novelty_and_loss_equal_numpy(numpy_network):
    rnd, seen, visited = make_rnd(), 3 + 2 * make_observations(), make_observations(seed=1)
    rnd.observe(th.from_numpy(seen))
    inputs = np.clip((visited - seen.mean(axis=0)) / seen.std(axis=0), -5, 5)
    gap = numpy_network(rnd.predictor, inputs) - numpy_network(rnd.target, inputs)
    expected = np.square(gap).sum(axis=1)
    actions = np.zeros(len(visited), dtype=np.int64)
    np.testing.assert_allclose(rnd.score(seen, actions, visited), expected, rtol=1e-3)
    loss = rnd.update(*(th.from_numpy(part) for part in (seen, actions, visited)))
    assert loss == {"loss": pytest.approx(expected.mean(), rel=1e-3)}


def test_the_predictor_learns_and_the_target_stays():
    rnd = make_rnd()
    target, predictor = (copy.deepcopy(net.state_dict()) for net in (rnd.target, rnd.predictor))
    batch = [th.from_numpy(make_observations(seed=seed)) for seed in (0, 1)]
    rnd.update(batch[0], th.zeros(20), batch[1])
    for name, weights in rnd.target.state_dict().items():
        assert th.equal(weights, target[name])
    for name, weights in rnd.predictor.state_dict().items():
        assert not th.equal(weights, predictor[name])


def test_a_bonus_must_have_something_to_train():
    rnd = make_rnd().requires_grad_(False)
    with pytest.raises(ValueError, match="RND must have a parameter that is trained"):
        rnd._begin()
