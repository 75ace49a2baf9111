import json
import random

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from saved_files import through_a_file

from curiosity_algos.common.randomness import (
    EpisodeSeeds,
    GlobalGenerators,
    SpaceGenerator,
    generator_state,
    load_generator_state,
    reseed,
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


def test_a_space_samples_on_from_a_saved_state():
    space, other = (spaces.Box(-1, 1, (3,), seed=seed) for seed in (0, 1))
    space.sample()
    state = SpaceGenerator(space).state_dict()
    expected = space.sample()
    SpaceGenerator(other).load_state_dict(state)
    np.testing.assert_array_equal(other.sample(), expected)


class TestGlobalGenerators:
    def draw(self):
        return th.rand(2).tolist(), np.random.rand(2).tolist()  # noqa: NPY002

    @pytest.fixture
    def make(self):
        return lambda seed=0: GlobalGenerators(np.random.SeedSequence(seed), th.device("cpu"))

    def test_a_run_goes_on_where_it_was(self, make):
        alone, disturbed = make(), make()
        with alone.lent():
            expected = [self.draw(), self.draw()]
        with disturbed.lent():
            drawn = [self.draw()]
        self.draw()
        th.manual_seed(9)
        with disturbed.lent():
            drawn.append(self.draw())
        assert drawn == expected

    def test_what_others_draw_stays_as_it_was(self, make):
        th.manual_seed(1)
        np.random.seed(1)  # noqa: NPY002
        expected = [self.draw(), self.draw()]
        th.manual_seed(1)
        np.random.seed(1)  # noqa: NPY002
        drawn = [self.draw()]
        with make().lent():
            self.draw()
        assert [*drawn, self.draw()] == expected

    def test_an_error_gives_them_back(self, make):
        generators, state = make(), th.get_rng_state()

        def interrupted():
            with generators.lent():
                self.draw()
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            interrupted()
        assert th.equal(th.get_rng_state(), state)
        with generators.lent():
            second = self.draw()
        assert second != self.first_draw(make())

    def first_draw(self, generators):
        with generators.lent():
            return self.draw()

    def test_seeds_differ(self, make):
        assert self.first_draw(make(0)) != self.first_draw(make(1))
        assert self.first_draw(make(0)) == self.first_draw(make(0))

    @pytest.mark.parametrize("n_drawn", [0, 1, 700])
    def test_states_are_taken_within_and_without(self, make, n_drawn):
        generators, other = make(), make(1)
        with generators.lent():
            np.random.standard_normal(n_drawn)  # noqa: NPY002  odd numbers leave one behind
            state = through_a_file(generators.state_dict())
            expected = np.random.standard_normal(), self.draw()  # noqa: NPY002
        other.load_state_dict(state)
        after = generators.state_dict()
        with other.lent():
            assert (np.random.standard_normal(), self.draw()) == expected  # noqa: NPY002
        assert th.equal(other.state_dict()["torch"], after["torch"])


class Part:
    """Holds what it is given."""

    def __init__(self, **attributes):
        vars(self).update(attributes)


class Hidden:
    """Has a slot whose name is mangled, and one that is never filled."""

    __slots__ = ("__rng", "empty")

    def __init__(self, rng):
        self.__rng = rng


class Slotted(Hidden):
    """Inherits its slots."""

    __slots__ = ()


class TestReseed:
    def make(self, seed):
        shared = np.random.default_rng(seed)
        return Part(
            rng=shared,
            nested={"a": [Part(generator=th.Generator().manual_seed(seed)), (shared,)]},
            module=th.nn.Linear(2, 2),
            others=[np.random.default_rng(seed), np.random.Generator(np.random.MT19937(seed))],
        )

    def draws(self, part):
        generator = part.nested["a"][0].generator
        numbers = [each.random() for each in (part.rng, *part.others)]
        return [*numbers, th.rand((), generator=generator).item()]

    def test_the_seed_decides_whatever_was_drawn_before(self):
        one, other = self.make(0), self.make(1)
        self.draws(one)
        for part in (one, other):
            reseed([part, Part(part=part)], np.random.SeedSequence(5))
        drawn = self.draws(one)
        assert drawn == self.draws(other)
        assert len(set(drawn)) == len(drawn)  # from a seed each
        reseed([one], np.random.SeedSequence(6))
        assert not set(self.draws(one)) & set(drawn)

    @pytest.mark.parametrize("make", [np.random.default_rng, np.random.RandomState, random.Random])
    @pytest.mark.parametrize("keep", [lambda rng: Part(rng=rng), Slotted])
    def test_every_kind_is_found(self, make, keep):
        one, twin = make(0), make(1)
        for each in (one, twin):
            reseed([keep(each)], np.random.SeedSequence(3))
        assert one.random() == twin.random() != make(0).random()

    def test_those_of_the_process_stay(self):
        random.seed(3), np.random.seed(3)  # noqa: NPY002
        shared = [random.random.__self__, np.random.random.__self__]
        before = random.getstate(), np.random.get_state()  # noqa: NPY002
        reseed([Part(shared=shared)], np.random.SeedSequence(5))
        np.testing.assert_equal((random.getstate(), np.random.get_state()), before)  # noqa: NPY002

    def test_what_refers_to_itself_ends(self):
        part = Part()
        part.itself = [part, {"part": part}]
        part.rng = np.random.default_rng(0)
        reseed([part], np.random.SeedSequence(3))
        other = Part(rng=np.random.default_rng(1))
        reseed([other], np.random.SeedSequence(3))
        assert part.rng.random() == other.rng.random()

    def test_spaces_and_envs_stay_as_they_are(self, make_maze):
        env, space = make_maze(), spaces.Discrete(100)
        space.seed(0)
        env.reset(seed=0)
        states = [generator_state(each.np_random) for each in (space, env.unwrapped)]
        reseed([Part(env=env, space=space)], np.random.SeedSequence(5))
        assert [generator_state(each.np_random) for each in (space, env.unwrapped)] == states
