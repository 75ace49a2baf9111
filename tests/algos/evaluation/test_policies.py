from itertools import pairwise

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.evaluation.mlp import act, build_mlp
from curiosity_algos.evaluation.policies import MlpPolicy

NET_ARCHS = [[], [32, 16], [5], [7, 3, 2], [33, 1, 17, 4]]


def box(n, low=-1.0, high=1.0):
    return spaces.Box(low, high, (n,))


def layers_of(vector, sizes):
    """Weights (inputs, outputs) and biases of each layer, by the documented layout."""
    layers, offset = [], 0
    for n_in, n_out in pairwise(sizes):
        weights = vector[offset : offset + n_in * n_out].reshape(n_in, n_out)
        offset += n_in * n_out
        layers.append((weights, vector[offset : offset + n_out]))
        offset += n_out
    assert offset == len(vector)
    return layers


def torch_outputs(vector, sizes, observations):
    """The network before its output range, by torch in double precision."""
    x = th.from_numpy(observations).double()
    for i, (weights, biases) in enumerate(layers_of(vector, sizes)):
        linear = th.nn.Linear(*weights.shape, dtype=th.float64)
        linear.weight.data[:] = th.from_numpy(weights.T)
        linear.bias.data[:] = th.from_numpy(biases)
        x = linear(th.relu(x) if i else x)
    return x.detach().numpy()


class TestForward:
    @pytest.mark.parametrize("net_arch", NET_ARCHS, ids=str)
    def test_box_actions_equal_torch(self, net_arch):
        rng = np.random.default_rng(0)
        low, high = np.float32(rng.uniform(-3, 0, 2)), np.float32(rng.uniform(1, 4, 2))
        mlp = build_mlp(box(36), spaces.Box(low, high), net_arch)
        parameters = rng.normal(0, 0.5, (4, mlp.n_parameters)).astype(np.float32)
        observations = rng.normal(0, 1, (4, 36)).astype(np.float32)
        actions = act(mlp, parameters, observations)
        sizes = [36, *net_arch, 2]
        outputs = [
            torch_outputs(vector, sizes, observation[None])[0]
            for vector, observation in zip(parameters, observations, strict=True)
        ]
        expected = (low + high) / 2 + (high - low) / 2 * np.tanh(outputs)
        assert actions.dtype == np.float32
        np.testing.assert_allclose(actions, expected, rtol=0, atol=1e-5)

    @given(
        st.floats(-1e6, 1e6, width=32),
        st.floats(2**-10, 1e6, width=32),
        st.floats(-1e4, 1e4),
    )
    def test_actions_stay_within_the_box(self, low, width, output):
        high = np.nextafter(np.float32(low + width), np.float32(np.inf))
        space = spaces.Box(np.float32(low), high, (1,))
        mlp = build_mlp(box(1), space, [])
        action = act(mlp, np.array([[0, output]], dtype=np.float32), np.zeros((1, 1)))[0]
        assert space.contains(action)

    def test_saturated_outputs_are_the_bounds(self):
        mlp = build_mlp(box(1), box(1, -2, 3), [])
        parameters = np.array([[0, 1e30], [0, -1e30], [0, 0]], dtype=np.float32)
        np.testing.assert_array_equal(
            act(mlp, parameters, np.zeros((3, 1))), [[3.0], [-2.0], [0.5]]
        )

    def test_layout_by_hand(self):
        mlp = build_mlp(box(2), spaces.Discrete(3), [])
        assert mlp.n_parameters == 9
        # Weights of the first input, of the second, then biases, one entry an action.
        vector = np.array([[1, 0, 0, 0, 2, 0, 0, 0, 1.5]], dtype=np.float32)
        observations = np.array([[2, 0], [0, 1], [0, 0], [-9, -9]], dtype=np.float32)
        scores = act(mlp, vector, observations)
        np.testing.assert_array_equal(
            scores, [[2, 0, 1.5], [0, 2, 1.5], [0, 0, 1.5], [-9, -18, 1.5]]
        )

    def test_one_policy_or_one_each_and_any_dtype(self):
        rng = np.random.default_rng(2)
        mlp = build_mlp(box(3), box(2), [4])
        vector = rng.normal(0, 1, mlp.n_parameters).astype(np.float32)
        observations = rng.integers(-3, 3, (5, 3))
        shared = act(mlp, vector[None], observations)
        each = act(mlp, np.tile(vector, (5, 1)), np.asfortranarray(observations.astype(np.float64)))
        np.testing.assert_array_equal(shared, each)


class TestErrors:
    @pytest.mark.parametrize(
        ("observations", "actions", "net_arch", "message"),
        [
            (spaces.Box(0, 255, (84, 84, 3), np.uint8), box(2), [], "at most 4096 entries"),
            (spaces.Dict(a=spaces.Discrete(4000), b=box(97)), box(2), [], "at most 4096 entries"),
            (box(2), spaces.Box(-np.inf, np.inf, (2, 2)), [], "a Box must be bounded"),
            (box(2), spaces.Box(0, 1, (2,), np.bool_), [], "a Box must be bounded, of numbers"),
            (box(2), box(2), [32, -1], "`net_arch` must be a whole number"),
        ],
    )
    def test_name_what_is_wrong(self, observations, actions, net_arch, message):
        with pytest.raises(ValueError, match=message):
            build_mlp(observations, actions, net_arch)

    def test_vectors_and_4096_entries_are_fine(self):
        for space, n in [(box(5000), 5000), (spaces.Box(0, 255, (64, 64), np.uint8), 4096)]:
            assert build_mlp(space, box(2), []).n_parameters == 2 * (n + 1)


class TestMlpPolicy:
    @pytest.fixture
    def policy(self):
        policy = MlpPolicy(box(3), box(2, -2, 5), [4])
        policy.vector[:] = np.random.default_rng(0).normal(0, 1, policy.mlp.n_parameters)
        return policy

    def test_a_pair_with_a_dictionary_is_an_observation(self):
        """And not what `reset` returns, for which SB3 takes it."""
        inner = spaces.Dict(x=spaces.Discrete(2))
        policy = MlpPolicy(spaces.Tuple([box(2), inner]), spaces.Discrete(3), [4])
        policy.vector[:] = np.random.default_rng(0).normal(size=policy.mlp.n_parameters)
        points = np.eye(2, dtype=np.float32)
        one = [policy.predict((point, {"x": i}))[0] for i, point in enumerate(points)]
        assert policy.predict((points, {"x": np.arange(2)}))[0].tolist() == one
        with pytest.raises(ValueError, match="You have passed a tuple"):
            MlpPolicy(box(2), box(2)).predict((points[0], {}))

    def test_predict_is_the_evaluators_function(self, policy):
        observations = np.random.default_rng(1).normal(0, 1, (6, 3)).astype(np.float32)
        expected = act(policy.mlp, policy.vector[None], observations)
        actions, state = policy.predict(observations)
        np.testing.assert_array_equal(actions, expected)
        assert state is None
        for observation, action in zip(observations, expected, strict=True):
            np.testing.assert_array_equal(policy.predict(observation)[0], action)

    def test_saves_and_loads(self, policy, tmp_path):
        policy.save(tmp_path / "policy.pth")
        loaded = MlpPolicy.load(tmp_path / "policy.pth")
        np.testing.assert_array_equal(loaded.vector, policy.vector)
        assert loaded.net_arch == [4]
