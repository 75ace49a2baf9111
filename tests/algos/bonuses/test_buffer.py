from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_algos.bonuses.buffer import TransitionBuffer


def transitions(numbers):
    """Transitions that carry their number in every entry: (n, 2), (n, 1), (n, 2)."""
    column = th.tensor(numbers, dtype=th.float32).reshape(-1, 1)
    return column.repeat(1, 2), column * 10, column.repeat(1, 2) + 0.5


def fill(buffer, n, first=0):
    buffer.add(*transitions(range(first, first + n)))
    return buffer


def make_buffer(capacity=10, seed=0):
    return TransitionBuffer(capacity, spaces.Box(-1, 1, (2,)), 1, seed=np.random.SeedSequence(seed))


def held(buffer):
    """Numbers of the transitions that samples show."""
    return set(buffer.sample(2000)[0][:, 0].int().tolist())


@settings(deadline=None)
@given(st.integers(1, 12), st.lists(st.integers(1, 30), max_size=6), st.integers(0, 99))
def test_a_ring_holds_the_newest(capacity, batches, seed):
    buffer, added = make_buffer(capacity, seed), []
    for n in batches:
        fill(buffer, n, first=len(added))
        added += range(len(added), len(added) + n)
        newest = added[-capacity:]
        assert len(buffer) == len(newest)
        assert held(buffer) == set(newest)


def test_sampling_is_uniform():
    buffer = fill(make_buffer(), 10)
    counts = np.bincount(buffer.sample(20_000)[0][:, 0].int().numpy(), minlength=10)
    assert counts.min() > 1800
    assert counts.max() < 2200


def test_sampling_is_seeded_and_leaves_torchs_own_draws_alone():
    before = th.get_rng_state()
    samples = [fill(make_buffer(seed=seed), 10).sample(50)[0] for seed in (3, 3, 4)]
    assert th.equal(before, th.get_rng_state())
    assert th.equal(samples[0], samples[1])
    assert not th.equal(samples[0], samples[2])


@pytest.mark.parametrize("n", [4, 10, 17])
def test_a_state_resumes_the_ring_and_the_draws(n):
    one, other = fill(make_buffer(), n), make_buffer(seed=5)
    one.sample(3)
    other.load_state_dict(one.state_dict())
    for buffer in (one, other):
        fill(buffer, 3, first=100)
    assert len(one) == len(other)
    for part, twin in zip(one.sample(50), other.sample(50), strict=True):
        assert th.equal(part, twin)


def test_images_stay_bytes():
    images = spaces.Box(0, 255, (3, 36, 36), np.uint8)
    buffer = TransitionBuffer(4, images, 1, seed=np.random.SeedSequence(0))
    pictures = th.randint(256, (6, 3, 36, 36), dtype=th.uint8)
    buffer.add(pictures[:-1], th.arange(5.0), pictures[1:])
    observations, actions, next_observations = buffer.sample(20)
    assert observations.dtype == next_observations.dtype == th.uint8
    places = actions.ravel().long()
    assert set(places.tolist()) == {1, 2, 3, 4}
    assert th.equal(observations, pictures[places])
    assert th.equal(next_observations, pictures[places + 1])


@pytest.mark.parametrize("n", [3, 10, 17])
@pytest.mark.parametrize("capacity", [4, 30])
def test_a_state_of_another_capacity_gives_its_newest(n, capacity):
    one, other = fill(make_buffer(), n - 2), make_buffer(capacity=capacity)
    fill(one, 2, first=n - 2)  # from where the ring may turn
    other.load_state_dict(one.state_dict())
    newest = range(max(0, n - min(10, capacity)), n)
    assert held(other) == set(newest)
    fill(other, 1, first=100)
    assert held(other) == {*newest[-(capacity - 1) :], 100}


def test_it_warns_before_memory_ends(monkeypatch):
    space, free = spaces.Box(0, 255, (84, 84, 4), np.uint8), SimpleNamespace(available=1e9)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: free)
    with pytest.warns(UserWarning, match=r"`buffer_size` of 20000 .* 1\.1 GB .* 1\.0 GB are free"):
        TransitionBuffer(20_000, space, 1, seed=np.random.SeedSequence(0))
    make_buffer(1_000_000)


def test_by_default_it_keeps_a_gib_of_images():
    images, seed = spaces.Box(0, 255, (84, 84, 4), np.uint8), np.random.SeedSequence(0)
    assert TransitionBuffer(None, images, 1, seed=seed).capacity == 2**30 // (2 * 84 * 84 * 4)
    assert make_buffer(None).capacity == 100_000
