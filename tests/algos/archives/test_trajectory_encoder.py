import copy
import math

import numpy as np
import pytest
import torch as th
from hypothesis import given, settings
from hypothesis import strategies as st
from padded_rollouts import rollouts_of
from saved_files import through_a_file
from torch_threads import heavy_threads

from curiosity_algos.archives.trajectory_encoder import EvenStates, TrajectoryEncoder

N_OBSERVATIONS = 3


def make_rollouts(lengths, *, n_padding=0, n_observations=2):
    """Episodes whose states begin with individual and time, padded with NaN."""
    shape = len(lengths), max(lengths) + n_padding + 1, n_observations
    observations = np.full(shape, np.nan, dtype=np.float32)
    for i, length in enumerate(lengths):
        observations[i, : length + 1] = 0.0
        observations[i, : length + 1, 0] = i
        observations[i, : length + 1, 1] = np.arange(length + 1)
    return rollouts_of(observations, lengths)


def make_states(n=200, n_states=10, seed=0):
    """Trajectories of two hidden numbers: straight lines from the origin, of uneven scales."""
    rng = np.random.default_rng(seed)
    ends = rng.uniform(-1.0, 1.0, (n, 2)) @ np.array([[1.0, 0.5, 0.0], [0.0, 1.0, 2.0]])
    times = np.linspace(0.0, 1.0, n_states)
    states = times[None, :, None] * ends[:, None] * [1.0, 100.0, 0.1] + [0.0, 3000.0, 0.0]
    return states.astype(np.float32)


def make_encoder(*, states=None, seed=0, **changes):
    """An encoder that has begun, with trajectories as long as `states`."""
    kwargs = {"share": 0.5, "learning_rate": 1e-2, "n_epochs": 20, "batch_size": 32} | changes
    encoder = TrajectoryEncoder(
        2, **kwargs, seed=np.random.SeedSequence(seed), device=th.device("cpu")
    )
    if states is not None:
        n_states, n_observations = states.shape[1:]
        rollouts = make_rollouts([int(n_states / encoder.share)], n_observations=n_observations)
        assert encoder.begin(rollouts) == encoder.shape == (n_states, n_observations)
    return encoder


def sample_states(rollouts, n):
    (states,) = EvenStates(n)(rollouts, slice(0, len(rollouts)))
    return states


class TestEvenStates:
    @settings(deadline=None)
    @given(st.lists(st.integers(1, 30), min_size=1, max_size=6), st.integers(2, 40))
    def test_they_are_evenly_spaced_in_the_own_episode(self, lengths, n):
        states = sample_states(make_rollouts(lengths, n_padding=3), n)
        assert states.shape == (len(lengths), n, 2)
        assert states.dtype == np.float32
        for i, length in enumerate(lengths):
            assert (states[i, :, 0] == i).all()
            times = states[i, :, 1]
            assert (times[0], times[-1]) == (0, length)
            exact = [length * k / (n - 1) for k in range(n)]
            assert np.abs(times - exact).max() <= 0.5 + 1e-6

    @pytest.mark.parametrize(
        ("lengths", "share", "n_states"),
        [([10, 4], 0.4, 4), ([10, 11], 0.4, 5), ([7], 1.0, 7), ([1], 0.1, 2)],
    )
    def test_the_longest_episode_tells_how_many(self, lengths, share, n_states):
        encoder, rollouts = make_encoder(share=share), make_rollouts(lengths, n_padding=9)
        assert encoder.shape is None
        assert encoder.begin(rollouts) == encoder.shape == (n_states, 2)
        np.testing.assert_array_equal(encoder.states(rollouts), sample_states(rollouts, n_states))
        # Those that come later are seen as often, however long.
        later = make_rollouts([50, 2])
        np.testing.assert_array_equal(encoder.states(later), sample_states(later, n_states))


class TestTraining:
    def test_trajectories_are_drawn_ever_better(self):
        states = make_states()
        encoder = make_encoder(states=states, n_epochs=1)
        assert math.isnan(encoder.loss)
        losses = []
        for _ in range(60):
            encoder.train(states)
            losses.append(encoder.loss)
        assert losses[0] > 0.3
        assert losses[-1] < 0.1 * losses[0]

    def test_it_needs_gradients(self):
        states = make_states()
        encoder = make_encoder(states=states)
        with th.no_grad(), pytest.raises(RuntimeError, match="`learn` must be called outside"):
            encoder.train(states)

    def test_the_scale_is_taken_anew(self):
        """Old data, or what it was scaled by, leaves no trace in how inputs are scaled."""
        states = make_states()
        one, other = (make_encoder(states=states, n_epochs=1) for _ in range(2))
        one.train(1000.0 * states - 50.0)
        one.train(states)
        other.train(states)
        for name in ("mean", "variance", "count"):
            scales = [
                encoder.state_dict()["modules"][f"0.{name}"].numpy() for encoder in (one, other)
            ]
            np.testing.assert_array_equal(*scales)
        rows = states.reshape(-1, N_OBSERVATIONS).astype(np.float64)
        scales = one.state_dict()["modules"]
        np.testing.assert_allclose(scales["0.mean"], rows.mean(axis=0), rtol=1e-9)
        np.testing.assert_allclose(scales["0.variance"], rows.var(axis=0), rtol=1e-6)

    def test_it_has_one_of_torchs_threads_and_none_of_its_draws(self):
        states, before = make_states(), th.get_rng_state()
        with heavy_threads() as threads:
            encoder = make_encoder(states=states, n_epochs=1)
            encoder.train(states)
            encoder.encode(states)
        assert threads == {1}
        assert th.equal(before, th.get_rng_state())


def test_what_a_trajectory_is_in_any_company():
    states = make_states(150)
    encoder, other = (make_encoder(states=states, seed=seed) for seed in (0, 1))
    assert not np.array_equal(encoder.encode(states), other.encode(states))
    encoder.train(states)
    together = encoder.encode(states)
    np.testing.assert_array_equal(encoder.encode(states), together)
    alone = np.concatenate([encoder.encode(states[i : i + 1]) for i in range(len(states))])
    np.testing.assert_allclose(alone, together, atol=1e-5)
    np.testing.assert_allclose(encoder.encode(states[::-1].copy()), together[::-1], atol=1e-5)
    assert np.ptp(together, axis=0).min() > 0.1


class TestStates:
    def test_training_goes_on_in_every_bit(self, assert_same):
        states = make_states()
        one, other = make_encoder(states=states), make_encoder(seed=1)
        one.train(states)
        other.load_state_dict(through_a_file(one.state_dict()))
        assert (other.shape, other.loss) == (one.shape, one.loss)
        np.testing.assert_array_equal(other.encode(states), one.encode(states))
        for encoder in (one, other):
            encoder.train(make_states(seed=1))
        assert_same(one.state_dict(), other.state_dict())
        np.testing.assert_array_equal(other.encode(states), one.encode(states))

    def test_one_that_has_not_begun(self):
        states = make_states(20)
        fresh = make_encoder()
        for other in (make_encoder(seed=1), make_encoder(seed=1, states=states)):
            other.load_state_dict(through_a_file(make_encoder().state_dict()))
            assert other.shape is None
            assert math.isnan(other.loss)
        rollouts = make_rollouts([6, 4])
        for encoder in (fresh, other):
            encoder.begin(rollouts)
        latents = [encoder.encode(encoder.states(rollouts)) for encoder in (fresh, other)]
        np.testing.assert_array_equal(*latents)

    def test_a_state_belongs_to_nobody(self, assert_same):
        states = make_states(40)
        one, other = make_encoder(states=states), make_encoder(seed=1)
        one.train(states)
        state = one.state_dict()
        kept = copy.deepcopy(state)
        other.load_state_dict(state)
        for encoder in (one, other):
            encoder.train(states)
        assert_same(state, kept)
