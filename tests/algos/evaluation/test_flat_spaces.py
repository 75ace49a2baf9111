import numpy as np
import pytest
from gymnasium import spaces
from toys import Words

from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations, numeric, stack

MINIGRID = {"image": spaces.Box(0, 255, (7, 7, 3), np.uint8), "direction": spaces.Discrete(4)}
OBSERVATIONS = {
    "matrix": (spaces.Box(-9, 9, (2, 2)), [[1, 2], [3, 4]], [1, 2, 3, 4]),
    "scalar": (spaces.Box(-9, 9, ()), 5.0, [5]),
    "discrete": (spaces.Discrete(4, start=-1), 1, [0, 0, 1, 0]),
    "bits": (spaces.MultiBinary([2, 2]), [[0, 1], [1, 1]], [0, 1, 1, 1]),
    "choices": (spaces.MultiDiscrete([2, 3], start=[1, 0]), [2, 1], [0, 1, 0, 1, 0]),
    "dict": (
        spaces.Dict([("z", spaces.Discrete(2)), ("a", spaces.Box(0, 9, (2,)))]),
        {"z": 1, "a": [7, 8]},
        [7, 8, 0, 1],  # in the order of their names
    ),
    "tuple": (spaces.Tuple([spaces.Discrete(3), spaces.Discrete(2)]), (2, 0), [0, 0, 1, 1, 0]),
    "nested": (
        spaces.Dict(
            a=spaces.Dict([("z", spaces.Discrete(2)), ("b", spaces.Box(0, 9, (2,)))]),
            c=spaces.Tuple([spaces.Dict(d=spaces.MultiBinary(2)), spaces.Discrete(2, start=1)]),
        ),
        {"a": {"z": 0, "b": [7, 8]}, "c": ({"d": [0, 1]}, 2)},
        [7, 8, 1, 0, 0, 1, 0, 1],
    ),
}
"""A space, one of its observations, and what is seen of it by hand."""
WRONG = [
    (spaces.Discrete(3), [0, 3]),
    (spaces.Discrete(3, start=1), [1, 0]),
    (spaces.MultiDiscrete([2, 3]), [[0, 2], [0, -1]]),
    (spaces.Box(0, 1, (2, 2)), np.zeros((2, 4))),
    (spaces.Box(0, 1, (2,)), np.zeros((2, 1))),
]
"""A space, and two observations of which the last is none of it."""
ACTIONS = {
    "start": (spaces.Discrete(3, start=5), [0, 2, 1], 1, 6),
    "bits": (spaces.MultiBinary([2, 2]), [1, -1, 0, 0.5], [1, 0, 0, 1], [[1, 0], [0, 1]]),
    "choices": (
        spaces.MultiDiscrete([2, 3], start=[0, 7], dtype=np.int32),
        [1, 2, 0, 9, 3],
        [0, 1, 0, 1, 0],
        [1, 8],
    ),
    "matrix": (spaces.Box(-1, 1, (2, 1), np.float64), [0.5, -1], [0.5, -1], [[0.5], [-1]]),
    "integers": (spaces.Box(-3, 3, (2,), np.int8), [-2.6, 0.4], [-3, 0], [-3, 0]),
    "bytes": (spaces.Box(0, 255, (1, 2), np.uint8), [254.6, 255], [255, 255], [[255, 255]]),
}
"""A space, outputs of a network, and the action as a bonus and as the environment has it."""


@pytest.mark.parametrize(
    ("space", "observation", "expected"), OBSERVATIONS.values(), ids=OBSERVATIONS
)
def test_observations_become_vectors(space, observation, expected):
    seen, others = FlatObservations(space), [space.sample() for _ in range(3)]
    np.testing.assert_array_equal(seen.one(observation), expected)
    assert seen.space.shape == (len(expected),)
    assert not seen.is_batch(observation)

    batch = stack(space, [observation, *others])
    assert seen.is_batch(batch)
    vectors = seen.many(batch)
    np.testing.assert_array_equal(vectors, [expected, *map(seen.one, others)])
    for vector, other in zip(vectors[1:], others, strict=True):
        assert seen.space.contains(vector.astype(seen.space.dtype))
        np.testing.assert_array_equal(vector, spaces.flatten(numeric(space), other))
    for own, again in zip(seen.many(seen.own(vectors)), vectors, strict=True):
        np.testing.assert_array_equal(own, again)


@pytest.mark.parametrize(("space", "observations"), WRONG, ids=str)
def test_observations_of_another_space_are_refused(space, observations):
    seen = FlatObservations(space)
    with pytest.raises(ValueError, match="`env` must give, and take, values of its space"):
        seen.many(observations)
    if len(space.shape) == 1 and isinstance(space, spaces.Box):
        with pytest.raises(ValueError, match="`env` must give, and take, values of its space"):
            seen.one(observations[1])


CARDS = spaces.Sequence(spaces.Discrete(2))


@pytest.mark.parametrize(
    ("space", "message"),
    [
        (spaces.Dict(MINIGRID | {"cards": CARDS}), "its entry 'cards' is a Sequence"),
        (spaces.Dict(a=spaces.Graph(spaces.Discrete(2), None)), "its entry 'a' is a Graph"),
        (spaces.Tuple([spaces.Discrete(2), spaces.Text(5)]), "its entry '1' is a Text"),
        (spaces.Dict(a=spaces.Tuple([spaces.Dict(b=CARDS)])), r"its entry 'a\.0\.b' is a Seq"),
        (spaces.Text(5), "it is a Text"),
        (spaces.Box(-1, 1, (0,)), "it has no numbers"),
        (spaces.Dict(a=spaces.Text(5), b=Words()), "it has no numbers"),
    ],
)
def test_observations_without_a_size_are_refused(space, message):
    with pytest.raises(ValueError, match=rf"observation space .*{message}.*FilterObservation"):
        FlatObservations(space)


@pytest.mark.parametrize("space", [spaces.Dict(a=spaces.Discrete(2)), spaces.Box(-1, 1, (0,))])
def test_actions_of_other_spaces_are_refused(space):
    with pytest.raises(ValueError, match=r"action space .* it must be Discrete, MultiDiscrete"):
        FlatActions(space)


def test_what_is_no_number_is_left_out_of_dictionaries():
    place = spaces.Box(-1, 1, (2,))
    inner = spaces.Dict(says=Words(), place=place)
    space = spaces.Dict(inner=inner, letter=spaces.Dict(text=spaces.Text(5)), says=Words())
    assert numeric(space) == spaces.Dict(inner=spaces.Dict(place=place))
    observation = {"inner": {"says": "go", "place": [1, 2]}, "letter": {"text": ""}, "says": ""}
    np.testing.assert_array_equal(FlatObservations(space).one(observation), [1, 2])
    assert not FlatObservations(space).is_batch(observation)


@pytest.mark.parametrize(("space", "outputs", "seen", "taken"), ACTIONS.values(), ids=ACTIONS)
def test_actions_are_the_environments_own(space, outputs, seen, taken):
    actions = FlatActions(space)
    chosen = actions.choose(np.array([outputs], dtype=np.float32))
    np.testing.assert_array_equal(chosen, [seen])
    action = actions.taken(chosen)[0]
    np.testing.assert_array_equal(action, taken)
    assert action.dtype == space.dtype
    assert space.contains(action)
    np.testing.assert_array_equal(actions.seen(np.array([taken, taken])), [seen, seen])
    sampled = np.array([space.sample() for _ in range(20)])
    np.testing.assert_allclose(actions.taken(actions.seen(sampled)), sampled, rtol=1e-6)


def test_vectors_are_taken_as_they_are():
    box = spaces.Box(-1, 1, (2,))
    seen, actions = FlatObservations(box), FlatActions(box)
    assert seen.space is actions.space is box
    outputs = np.array([[0.1, 0.2]], dtype=np.float32)
    assert actions.taken(actions.choose(outputs)) is outputs
    observation = np.array([1.0, 2.0])
    assert seen.one(observation) is observation


def test_columns_of_an_entry():
    seen = FlatObservations(OBSERVATIONS["dict"][0])
    assert (seen.columns("a"), seen.columns("z")) == (slice(0, 2), slice(2, 4))


def test_actions_are_of_their_space():
    box = spaces.Box(-0.1, 0.1, (2,), np.float64)
    actions = FlatActions(box).taken(np.array([[0.1, -0.1]], dtype=np.float32))
    assert actions.dtype == np.float64
    assert box.contains(actions[0])  # as float32, .1 is above
