"""Rollouts of episodes of several lengths, for tests that look at trajectories."""

import numpy as np

from curiosity_algos.evaluation.rollouts import Rollouts

N_OBSERVATIONS, HORIZON = 3, 12
LENGTHS = np.array([12, 1, 5, 9, 2])


def rollouts_of(observations, lengths, **others):
    """Rollouts of these trajectories without rewards and behaviors, but for what is given."""
    n, n_states = observations.shape[:2]
    given = {
        "returns": np.zeros(n),
        "lengths": np.array(lengths),
        "success": np.zeros(n, dtype=bool),
        "terminated": np.zeros(n, dtype=bool),
        "behaviors": np.zeros((n, 0)),
        "final_observations": observations[np.arange(n), lengths],
        "observations": observations,
        "actions": np.zeros((n, n_states - 1, 1), dtype=np.float32),
    }
    return Rollouts(**(given | others))


def make_rollouts(is_discrete=False, seed=0):
    """Rollouts whose padding is NaN, so that no use of it goes unseen."""
    rng = np.random.default_rng(seed)
    n = len(LENGTHS)
    observations = rng.normal(0, 1, (n, HORIZON + 1, N_OBSERVATIONS)).astype(np.float32)
    actions = rng.uniform(-1, 1, (n, HORIZON, 2)).astype(np.float32)
    if is_discrete:
        actions = rng.integers(0, 3, (n, HORIZON))
    for i, length in enumerate(LENGTHS):
        observations[i, length + 1 :] = np.nan
        actions[i, length:] = -99 if is_discrete else np.nan
    return rollouts_of(observations, LENGTHS, terminated=LENGTHS < HORIZON, actions=actions)


def only(rollouts, individuals):
    """Rollouts of some individuals alone."""
    given = {name: each for name, each in vars(rollouts).items() if isinstance(each, np.ndarray)}
    return Rollouts(**{name: array[individuals] for name, array in given.items()})
