import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.vector.utils import batch_space
from toys import Words

from curiosity_algos.evaluation.flat_spaces import FlatActions, FlatObservations, numeric

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
WRONG = {
    "beyond": (spaces.Discrete(3), 3),
    "below": (spaces.Discrete(3), -1),
    "choices": (spaces.MultiDiscrete([2, 3]), np.array([0, -1])),
    "shape": (spaces.Box(0, 1, (2, 2)), np.zeros((4,))),
    "no entry": (spaces.Dict(a=spaces.Discrete(2)), {"b": 1}),
    "too many": (spaces.Tuple([spaces.Discrete(2)]), (1, 1)),
    "no tuple": (spaces.Tuple([spaces.Discrete(2)]), 1),
}
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


def as_batch(observations, space):
    """Some observations as vector environments give them."""
    if isinstance(space, spaces.Dict):
        return {
            name: as_batch([each[name] for each in observations], space[name]) for name in space
        }
    if isinstance(space, spaces.Tuple):
        columns = zip(zip(*observations, strict=True), space, strict=True)
        return tuple(as_batch(column, entry) for column, entry in columns)
    return np.array(observations)


@pytest.mark.parametrize(
    ("space", "observation", "expected"), OBSERVATIONS.values(), ids=OBSERVATIONS
)
class TestObservations:
    def test_one_is_a_vector(self, space, observation, expected):
        seen = FlatObservations(space)
        np.testing.assert_array_equal(seen.one(observation), expected)
        assert seen.space.shape == (len(expected),)
        assert not seen.is_batch(observation)

    def test_many_are_vectors(self, space, observation, expected):
        seen, sample = FlatObservations(space), space.sample()
        batch = as_batch([observation, sample], space)
        np.testing.assert_array_equal(seen.many(batch), [expected, seen.one(sample)])
        assert seen.is_batch(batch)

    def test_samples_are_seen_within_the_bounds(self, space, observation, expected):
        seen = FlatObservations(space)
        for each in seen.many(batch_space(space, 3).sample()):
            assert seen.space.contains(each.astype(seen.space.dtype))


class TestRefusals:
    @pytest.mark.parametrize(("space", "observation"), WRONG.values(), ids=WRONG)
    def test_observations_of_another_space(self, space, observation):
        with pytest.raises(ValueError, match="`env` must give observations of its space"):
            FlatObservations(space).one(observation)

    @pytest.mark.parametrize(
        ("space", "batch"),
        [
            (spaces.Discrete(3), np.array([0, 3])),
            (spaces.Discrete(3, start=1), np.array([0, 1])),
            (spaces.MultiDiscrete([2, 3]), np.array([[0, 2], [2, 0]])),
            (spaces.Box(0, 1, (2, 2)), np.zeros((3, 4))),
            (spaces.Dict(a=spaces.Discrete(2)), {"b": np.array([0])}),
        ],
        ids=str,
    )
    def test_several_of_which_one_is_of_another_space(self, space, batch):
        with pytest.raises(ValueError, match="`env` must give observations of its space"):
            FlatObservations(space).many(batch)

    def test_what_predict_is_given_may_be_neither(self):
        with pytest.raises(ValueError, match="`observation` must be of the space"):
            FlatObservations(spaces.Dict(a=spaces.Discrete(2))).is_batch({"b": 1})

    @pytest.mark.parametrize(
        ("entry", "kind"),
        [
            (spaces.Sequence(spaces.Discrete(2)), "Sequence"),
            (spaces.Graph(spaces.Discrete(2), None), "Graph"),
            (spaces.OneOf([spaces.Discrete(2)]), "OneOf"),
        ],
    )
    def test_an_entry_of_no_fixed_size_is_named(self, entry, kind):
        space = spaces.Dict(MINIGRID | {"cards": entry})
        with pytest.raises(
            ValueError, match=rf"its entry 'cards' is a {kind}.*FilterObservation\.$"
        ):
            FlatObservations(space)
        assert FlatObservations(spaces.Dict(MINIGRID)).space.shape == (4 + 147,)

    def test_a_tuple_cannot_leave_entries_out(self):
        with pytest.raises(ValueError, match="its entry '1' is a Text"):
            FlatObservations(spaces.Tuple([spaces.Discrete(2), spaces.Text(5)]))

    def test_an_inner_entry_has_its_whole_name(self):
        nested = spaces.Dict(a=spaces.Tuple([spaces.Dict(b=spaces.Sequence(spaces.Discrete(2)))]))
        with pytest.raises(ValueError, match=r"its entry 'a\.0\.b' is a Sequence, no vector"):
            FlatObservations(nested)

    @pytest.mark.parametrize(
        "space", [spaces.Text(5), spaces.Graph(spaces.Discrete(2), None), None], ids=str
    )
    def test_what_has_no_fixed_size(self, space):
        with pytest.raises(
            ValueError, match=r"observation space .* it must be Box, Discrete, Multi"
        ):
            FlatObservations(space)

    @pytest.mark.parametrize(
        "space",
        [spaces.Box(-1, 1, (0,)), spaces.Dict(), spaces.Dict(a=spaces.Text(5), b=Words())],
        ids=str,
    )
    def test_nothing_to_see(self, space):
        with pytest.raises(ValueError, match=r"observation space .* must have at least one entry"):
            FlatObservations(space)

    @pytest.mark.parametrize(
        "space", [spaces.Dict(a=spaces.Discrete(2)), spaces.Box(-1, 1, (0,)), None], ids=str
    )
    def test_actions(self, space):
        with pytest.raises(ValueError, match=r"action space .* it must be Discrete, MultiDiscrete"):
            FlatActions(space)


class TestNumeric:
    def test_what_is_no_number_is_left_out_of_dictionaries(self):
        place = spaces.Box(-1, 1, (2,))
        inner = spaces.Dict(says=Words(), place=place)
        space = spaces.Dict(inner=inner, letter=spaces.Dict(text=spaces.Text(5)), says=Words())
        assert numeric(space) == spaces.Dict(inner=spaces.Dict(place=place))
        observation = {"inner": {"says": "go", "place": [1, 2]}, "letter": {"text": ""}, "says": ""}
        np.testing.assert_array_equal(FlatObservations(space).one(observation), [1, 2])
        assert not FlatObservations(space).is_batch(observation)

    @pytest.mark.parametrize(("space", "observation", "expected"), OBSERVATIONS.values())
    def test_others_stay(self, space, observation, expected):
        assert numeric(space) is space


@pytest.mark.parametrize(("space", "outputs", "seen", "taken"), ACTIONS.values(), ids=ACTIONS)
class TestActions:
    def test_the_environments_own(self, space, outputs, seen, taken):
        actions = FlatActions(space)
        chosen = actions.choose(np.array([outputs], dtype=np.float32))
        np.testing.assert_array_equal(chosen, [seen])
        action = actions.taken(chosen)[0]
        np.testing.assert_array_equal(action, taken)
        assert action.dtype == space.dtype
        assert space.contains(action)

    def test_a_bonus_sees_what_was_taken(self, space, outputs, seen, taken):
        actions = FlatActions(space)
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
