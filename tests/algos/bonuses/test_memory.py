"""A bounded, uniform sample of observations, and what an encoder makes of them."""

import threading

import numpy as np
import pytest
import torch as th

from curiosity_algos.bonuses.memory import FeatureMemory


class Encoder:
    """Two features of an observation; it counts what it is asked."""

    def __init__(self, factor=2.0):
        self.factor, self.asked = factor, []

    def __call__(self, observations):
        self.asked += observations.ravel().tolist()
        return self.factor * th.from_numpy(np.hstack([observations, -observations]))


def make_memory(size=10, seed=0, dtype=np.float32, n_features=2):
    return FeatureMemory(size, (1,), dtype, n_features, seed=seed, device=th.device("cpu"))


def column(*values):
    return np.array(values, dtype=np.float32)[:, None]


@pytest.mark.parametrize("chunk", [1, 50])
def test_each_observation_stays_with_the_same_chance(chunk):
    counts = np.zeros(200)
    for seed in range(600):
        memory = make_memory(10, seed)
        for begin in range(0, 200, chunk):
            memory.add(column(*range(begin, min(begin + chunk, 200))))
        kept = memory.observations.ravel().astype(int)
        assert len(set(kept)) == 10
        counts[kept] += 1
    # 600 trials of .05 each: 30, with a standard deviation of 5.3.
    assert abs(counts[:100].mean() - 30.0) < 1.5
    assert abs(counts[100:].mean() - 30.0) < 1.5
    assert counts.max() < 60
    assert counts.min() > 8


class TestFeatures:
    def test_only_what_is_new_is_encoded(self):
        memory, encode = make_memory(3), Encoder()
        memory.add(column(1, 2))
        assert memory.features(encode)[0].tolist() == [[2, -2], [4, -4]]
        memory.add(column(3))
        assert memory.features(encode)[0].tolist() == [[2, -2], [4, -4], [6, -6]]
        memory.features(encode)
        assert encode.asked == [1, 2, 3]

    def test_what_takes_the_place_of_another_is_new(self):
        memory, encode = make_memory(3), Encoder()
        memory.add(column(1, 2, 3))
        memory.features(encode)
        memory.add(column(*range(4, 40)))
        expected = np.hstack([2 * memory.observations, -2 * memory.observations])
        features, squares = memory.features(encode)
        np.testing.assert_array_equal(features, expected)
        np.testing.assert_array_equal(squares, (expected**2).sum(axis=1))
        assert max(expected[:, 0]) > 6

    def test_threads_that_ask_at_once_encode_once(self):
        memory, encode, given = make_memory(3), Encoder(), []
        gate = threading.Barrier(4)
        memory.add(column(1, 2))

        def ask():
            gate.wait()
            given.append(memory.features(encode)[0].tolist())

        threads = [threading.Thread(target=ask) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert given == [[[2, -2], [4, -4]]] * 4
        assert encode.asked == [1, 2]
