import json

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.common.randomness import (
    EpisodeSeeds,
    generator_state,
    load_generator_state,
)


@given(st.integers(0, 2**64), st.integers(0, 9))
def test_a_generator_goes_on_from_its_saved_state(seed, n_drawn):
    generator = np.random.default_rng(seed)
    # Odd numbers of 32-bit draws leave half a word behind, which belongs to the state too.
    generator.integers(2**31, size=n_drawn, dtype=np.int32)
    state = generator_state(generator)
    assert isinstance(json.loads(state), dict)
    expected = generator.standard_normal(5), generator.integers(2**31, size=3, dtype=np.int32)
    other = np.random.default_rng(seed + 1)
    load_generator_state(other, state)
    np.testing.assert_array_equal(other.standard_normal(5), expected[0])
    np.testing.assert_array_equal(other.integers(2**31, size=3, dtype=np.int32), expected[1])


def test_episode_seeds_differ_and_resume():
    seeds = EpisodeSeeds(np.random.SeedSequence(0))
    drawn = [seeds.draw() for _ in range(20)]
    assert len(set(drawn)) == 20
    assert all(0 <= seed < 2**31 for seed in drawn)
    state = seeds.state_dict()
    later = EpisodeSeeds(np.random.SeedSequence(1))
    later.load_state_dict(state)
    assert [later.draw() for _ in range(3)] == [seeds.draw() for _ in range(3)]
