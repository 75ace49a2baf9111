import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.bonuses.views import View

SPACE = spaces.Dict(
    {
        "place": spaces.Box(-1, 1, (2, 2)),
        "image": spaces.Box(0, 255, (7, 7, 3), np.uint8),
        "direction": spaces.Discrete(4),
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
    view, observations = View(spaces.Box(-1, 1, (2,))), np.ones((3, 2))
    assert view(observations) is observations
    assert view.one(observations[0]).tolist() == [1.0, 1.0]


def test_errors_name_the_key():
    with pytest.raises(ValueError, match=r"`observation_key` must be one of .*place.*, got 'goal'"):
        View(SPACE, "goal")
    with pytest.raises(ValueError, match="`observation_key` must be None where observations are"):
        View(spaces.Box(-1, 1, (2,)), "goal")

    class Mission(spaces.Space):
        pass

    for entry in (Mission(), spaces.Sequence(spaces.Discrete(2))):
        space = spaces.Dict({"place": spaces.Box(-1, 1, (2,)), "mission": entry})
        with pytest.raises(ValueError, match=r"`observation_key` must be one of .*no vector"):
            View(space)
        assert View(space, "place").space == spaces.Box(-1, 1, (2,))
