import numpy as np

from curiosity_algos import CanonicalES
from curiosity_algos.search.canonical import recombination_weights


def test_a_generation_is_the_canonical_step_on_returns(make_model, make_easy_maze):
    model, twin = (make_model(CanonicalES, make_easy_maze(), seed=3) for _ in range(2))
    for _ in range(4):
        center = twin._search.center
        population = twin._search.ask()
        returns = twin.evaluator.evaluate(population).returns
        best = population[np.argsort(-returns, kind="stable")[:3]]
        expected = center + 0.5 * (recombination_weights(3) @ (best - center))
        twin._search.tell(returns)
        model.learn(1, reset_num_timesteps=False)
        np.testing.assert_allclose(model._search.center, expected, atol=1e-6)


def test_the_center_learns_to_reach_the_goal(make_model, make_easy_maze):
    model = make_model(CanonicalES, make_easy_maze(), population_size=24, n_parents=12)
    before = model.evaluator.evaluate(model._ask()).returns.mean()
    model.learn(60_000)
    after = model.evaluator.evaluate(model._ask()).returns.mean()
    assert after > before + 0.2
