import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.bonuses.views import View

PLACE = spaces.Box(-1, 1, (2, 2))
SPACE = spaces.Dict(
    {
        "place": PLACE,
        "image": spaces.Box(0, 255, (7, 7, 3), np.uint8),
        "direction": spaces.Discrete(4, start=1),
        "switches": spaces.MultiBinary(3),
        "cards": spaces.MultiDiscrete([2, 3]),
    }
)


def observe(n, space=SPACE):
    """Observations one by one, and as a VecEnv gives them."""
    space.seed(0)
    rows = [space.sample() for _ in range(n)]
    return rows, {key: np.stack([row[key] for row in rows]) for key in space}


def test_all_entries_are_one_vector():
    rows, together = observe(3)
    view = View(SPACE)
    assert view.space == spaces.flatten_space(SPACE)
    np.testing.assert_array_equal(view(together), [spaces.flatten(SPACE, row) for row in rows])
    np.testing.assert_array_equal(view.one(rows[1]), view(together)[1])


def test_an_entry_stands_alone():
    rows, together = observe(3)
    view = View(SPACE, "image")
    assert view.space is SPACE["image"]
    np.testing.assert_array_equal(view(together), together["image"])
    np.testing.assert_array_equal(view.one(rows[2]), rows[2]["image"])


def test_an_array_is_seen_as_it_is():
    for shape in [(2,), (4, 4, 1)]:
        space, observations = spaces.Box(0, 255, shape, np.uint8), np.ones((3, *shape))
        view = View(space)
        assert view.space is space
        np.testing.assert_array_equal(view(observations), observations)
        np.testing.assert_array_equal(view.one(observations[0]), observations[0])


@pytest.mark.parametrize("key", sorted({*SPACE} - {"image"}))
def test_what_is_neither_vector_nor_image_is_flat(key):
    rows, together = observe(3)
    expected = [spaces.flatten(SPACE[key], row[key]) for row in rows]
    for view, observations in [(View(SPACE, key), together), (View(SPACE[key]), together[key])]:
        assert view.space == spaces.flatten_space(SPACE[key])
        np.testing.assert_array_equal(view(observations), expected)
    np.testing.assert_array_equal(View(SPACE[key]).one(rows[0][key]), expected[0])


def test_large_boxes_stay_what_bonuses_refuse():
    space = spaces.Box(0, 1, (84, 84, 3))
    assert View(space).space is space


def test_large_entries_are_seen_alone():
    space = spaces.Dict(image=spaces.Box(0, 255, (84, 84, 3), np.uint8), place=PLACE)
    with pytest.raises(ValueError, match=r"at most 4096 .* becomes 21172: let `observation_key`"):
        View(space)
    assert View(space, "image").space == space["image"]
    assert View(spaces.Discrete(5000)).space.shape == (5000,)


def test_values_beyond_memory_are_refused():
    with pytest.raises(ValueError, match=r"`env` must give .* at most 65536 numbers, Discrete"):
        View(spaces.Discrete(1_000_000))


def test_errors_name_the_key():
    with pytest.raises(ValueError, match=r"`observation_key` must be one of .*place.*, got 'goal'"):
        View(SPACE, "goal")
    with pytest.raises(ValueError, match="`observation_key` must be None where observations are"):
        View(PLACE, "goal")


def test_other_entries_are_refused():
    others = spaces.Dict(place=PLACE, several=spaces.Sequence(spaces.Discrete(2)))
    for space in (spaces.Dict(), others):
        with pytest.raises(ValueError, match=r"observation space .* is not supported: "):
            View(space)
    assert View(others, "place").space.shape == (4,)
