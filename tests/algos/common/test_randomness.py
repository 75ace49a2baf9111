import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given
from hypothesis import strategies as st
from saved_files import through_a_file

from curiosity_algos import CuriosityES
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.randomness import global_state, load_global_state, reseed


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


def draw():
    return th.rand(2).tolist(), np.random.standard_normal(), np.random.rand()  # noqa: NPY002


@pytest.mark.parametrize("n_drawn", [0, 1, 700])
def test_a_state_of_the_global_generators_goes_through_a_file(n_drawn):
    np.random.standard_normal(n_drawn)  # noqa: NPY002  odd numbers leave one behind
    state = through_a_file(global_state(th.device("cpu")))
    expected = draw()
    load_global_state(state, th.device("cpu"))
    assert draw() == expected


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

    @pytest.mark.parametrize("keep", [lambda rng: Part(rng=rng), Slotted])
    def test_slots_hold_some(self, keep):
        one, twin = (np.random.default_rng(seed) for seed in (0, 1))
        for each in (one, twin):
            reseed([keep(each)], np.random.SeedSequence(3))
        assert one.random() == twin.random() != np.random.default_rng(0).random()

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


def in_a_thread(function):
    """The error that a function ends with in a thread of its own."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(function).exception()


def test_a_second_model_is_refused_and_neither_run_changes(
    make_model, make_easy_maze, assert_same_run
):
    first, second, alone = (make_model(CuriosityES, make_easy_maze()) for _ in range(3))
    refused = []

    def learn_beside(locals_, globals_):
        refused.append(in_a_thread(lambda: second.learn(64)))
        return True

    first.learn(64, callback=learn_beside)
    assert {type(error) for error in refused} == {RuntimeError}
    assert str(refused[0]).startswith("One model learns at a time in a process")
    alone.learn(64)
    assert_same_run(first, alone)
    assert in_a_thread(lambda: second.learn(64)) is None
    assert_same_run(second, alone)


def test_a_callback_may_train_another(make_model, make_easy_maze, assert_same_run):
    outer, alone = (make_model(CuriosityES, make_easy_maze()).learn(1) for _ in range(2))
    inner = []

    def train_another(locals_, globals_):
        if not inner:
            inner.append(make_model(CuriosityES, make_easy_maze()).learn(64))
        return True

    outer.learn(128, callback=train_another, reset_num_timesteps=False)
    alone.learn(128, reset_num_timesteps=False)
    assert_same_run(outer, alone)
    assert_same_run(inner[0], make_model(CuriosityES, make_easy_maze()).learn(64))


def test_an_error_lets_the_next_one_learn(make_model, make_easy_maze):
    def fail(locals_, globals_):
        raise ZeroDivisionError

    model = make_model(CuriosityES, make_easy_maze())
    with pytest.raises(ZeroDivisionError):
        model.learn(1, callback=fail)
    assert in_a_thread(lambda: model.learn(1)) is None
