import numpy as np

from curiosity_algos.evaluation.coverage import BestPolicy, Firsts
from curiosity_algos.evaluation.rollouts import Rollouts


def test_of_a_generation_each_episode_has_its_own_end():
    firsts = Firsts()
    firsts.add(np.array([10, 15, 35]), np.array([0.0, 0.2, 0.1]), np.array([False, False, True]))
    assert (firsts.reward, firsts.success) == (15, 35)
    firsts.add(np.array([40]), np.ones(1), np.ones(1, dtype=bool))
    assert (firsts.reward, firsts.success) == (15, 35)


def test_the_best_policy_is_the_first_of_equals_or_the_first_success():
    best, policies = BestPolicy(1), np.arange(2, dtype=np.float32)[:, None]
    ends, no_behaviors = np.zeros((2, 1), np.float32), np.zeros((2, 0))
    for seed, returns, success, expected in [
        (1, [0.0, 0.0], [False, False], (0.0, 1, 0.0, False)),
        (2, [0.0, 0.0], [False, True], (0.0, 2, 1.0, True)),
        (3, [0.0, 0.0], [True, False], (0.0, 2, 1.0, True)),
        (4, [1.0, 2.0], [True, False], (2.0, 4, 1.0, True)),
        (5, [2.0, 1.0], [True, True], (2.0, 4, 1.0, True)),
    ]:
        one = np.ones(2, dtype=np.int64)
        arrays = np.array(returns), one, np.array(success), one > 0, no_behaviors, ends
        best.add(policies, Rollouts(*arrays), seed)
        assert (best.value, best.seed, best.parameters[0], best.has_reward) == expected
