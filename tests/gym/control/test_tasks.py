from types import SimpleNamespace

import numpy as np
import pytest
from suite import make_actions, make_reference

from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.tasks import TASKS, Stacker

pytestmark = pytest.mark.extra("control")


def test_the_stacker_s_reward_is_dm_controls_own():
    task, reference = Stacker(), make_reference("stacker")
    simulation = Simulation(task, 1)
    simulation.reset()
    reference.reset()
    rewards = []
    for action in make_actions("bang-bang", 600, 5, seed=3):
        simulation.step(action[None])
        rewards.append(task.reward(simulation._observe(slice(None)))[0])
        assert rewards[-1] == reference.step(action.astype(np.float64)).reward
    assert max(rewards) > 0.0


def test_the_stacker_succeeds_where_the_reward_is_at_its_threshold():
    threshold = 0.05
    task = Stacker(success_threshold=threshold)
    simulation = Simulation(task, 32)
    simulation.reset()
    actions = np.stack([make_actions("bang-bang", 400, 5, i) for i in range(32)], axis=1)
    for action in actions:
        solved = simulation.step(action)
        rewards = task.reward(simulation._observe(slice(None)))
        np.testing.assert_array_equal(solved, rewards >= threshold)


def test_the_stacker_refuses_thresholds_that_mean_nothing():
    for threshold in [0.0, 1.5, np.nan]:
        with pytest.raises(ValueError, match="`success_threshold` must be"):
            Stacker(success_threshold=threshold)


def test_tasks_are_equal_where_they_succeed_alike():
    for name, task in TASKS.items():
        assert [task() == TASKS[other]() for other in TASKS] == [name == each for each in TASKS]
        assert task(random_start=True) == task(random_start=True) != task()
    assert Stacker(success_threshold=0.2) != Stacker()
    assert Stacker(0.2, random_start=True) != Stacker(0.2)


class TestBehavior:
    def test_of_ball_in_cup_is_where_ball_and_cup_are(self):
        simulation = Simulation(TASKS["ball_in_cup"](), 1)
        simulation.reset()
        for action in make_actions("bang-bang", 100, 2):
            simulation.step(action[None])
        cup, ball = simulation.observations[0, :2], simulation.observations[0, 2:4]
        np.testing.assert_allclose(simulation.behaviors[0], [*ball, *cup], rtol=1e-6)

    def test_of_finger_wraps_the_hinge(self):
        simulation = Simulation(TASKS["finger"](), 5)
        simulation.reset()
        angles = np.array([-7.0, -np.pi, 0.5, np.pi, 9.0])
        simulation._batch.bind("qpos")[:, 2] = angles
        wrapped = simulation.behaviors[:, 2]
        np.testing.assert_allclose(np.exp(1j * wrapped), np.exp(1j * angles), atol=1e-12)
        assert (np.abs(wrapped) <= np.pi).all()

    def test_of_stacker_is_where_the_hand_is(self):
        simulation = Simulation(TASKS["stacker"](), 1)
        simulation.reset()
        for action in make_actions("bang-bang", 100, 5):
            simulation.step(action[None])
        np.testing.assert_allclose(
            simulation.behaviors[0], simulation.observations[0, 29:31], rtol=1e-6
        )

    def test_stays_within_its_bounds(self, name):
        task = TASKS[name]()
        simulation = Simulation(task, 16)
        simulation.reset()
        actions = [make_actions("bang-bang", 300, task.n_actions, i) for i in range(16)]
        for action in np.stack(actions, axis=1):
            simulation.step(action)
            unbounded = task.behavior(SimpleNamespace(**simulation._fields))
            overshoot = np.maximum(task.behavior_low - unbounded, unbounded - task.behavior_high)
            # Joint limits are soft: a push goes through them, and counts as at the end.
            assert overshoot.max() < (0.5 if name == "finger" else 0.0)
            at_end = np.where(unbounded > 0.0, task.behavior_high, task.behavior_low)
            expected = np.where(overshoot > 0.0, at_end, unbounded)
            np.testing.assert_array_equal(simulation.behaviors, expected)
