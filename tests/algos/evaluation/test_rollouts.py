import numpy as np
import pytest
from padded_rollouts import rollouts_of

from curiosity_algos.evaluation.rollouts import as_behaviors, concatenate


def test_trajectories_are_there_or_an_error():
    with pytest.raises(ValueError, match="hold no trajectories"):
        _ = part_of([4], 7).without_trajectories().trajectories


@pytest.mark.parametrize("odd", ["left", [1.0], 2.0, [[1.0, 2.0]], None], ids=repr)
def test_behaviors_are_alike(odd):
    with pytest.raises(ValueError, match=r"`env` must end every .* or none, got \[\[0.0, 1.0\], "):
        as_behaviors([[0.0, 1.0], odd])


def part_of(lengths, n_steps):
    """Rollouts whose trajectories are `n_steps` long, and hold where each step is."""
    n, steps = len(lengths), np.arange(n_steps + 1.0)
    observations = np.tile(steps, (n, 1))[:, :, None]
    return rollouts_of(observations, lengths, actions=np.tile(steps[:-1], (n, 1)))


@pytest.mark.parametrize("n_steps", [(2, 3), (5, 3), (2, 9), (7, 7)], ids=str)
def test_parts_are_joined_however_long_their_trajectories_are(n_steps):
    parts = [part_of(lengths, n) for lengths, n in zip([[1, 2], [3]], n_steps, strict=True)]
    joined = concatenate(parts)
    observations, actions = joined.trajectories
    assert (observations.shape, actions.shape) == ((3, 4, 1), (3, 3))
    for i, length in enumerate(joined.lengths):
        np.testing.assert_array_equal(observations[i, : length + 1, 0], np.arange(length + 1))
        np.testing.assert_array_equal(actions[i, :length], np.arange(length))


def test_parts_without_trajectories_leave_the_whole_without():
    joined = concatenate([part_of([1], 4), part_of([2], 4).without_trajectories()])
    assert (joined.observations, joined.actions) == (None, None)
    np.testing.assert_array_equal(joined.lengths, [1, 2])
