import os

import numpy as np
import pytest
from scripts import run_without_display
from suite import make_actions, play_reference

from curiosity_gym.control.simulation import RandomStarts, Simulation
from curiosity_gym.control.tasks import TASKS

pytestmark = pytest.mark.extra("control")

N_STEPS = 1000


def play(simulation, actions):
    """Observations (T + 1, n, O) and successes (T, n) of actions (T, n, A), never stopping."""
    simulation.reset()
    observations, solved = [simulation.observations.copy()], []
    for action in actions:
        solved.append(simulation.step(action))
        observations.append(simulation.observations.copy())
    return np.array(observations), np.array(solved)


class TestAgainstDmControl:
    @pytest.mark.parametrize("kind", ["uniform", "bang-bang"])
    def test_every_bit_is_the_same(self, name, kind):
        task = TASKS[name]()
        actions = np.stack(
            [make_actions(kind, N_STEPS, task.n_actions, seed) for seed in range(3)], axis=1
        )
        observations, solved = play(Simulation(task, 3, 2), actions)
        for i in range(3):
            expected, expected_solved = play_reference(name, actions[:, i])
            np.testing.assert_array_equal(observations[:, i], expected)
            np.testing.assert_array_equal(solved[:, i], expected_solved)
        moved = np.abs(observations[-1] - observations[0]).max(axis=1)
        assert (moved > 0.1).all()

    def test_actions_out_of_range_are_clipped(self, name):
        task = TASKS[name]()
        actions = 3.0 * make_actions("uniform", 50, task.n_actions)[:, None]
        wide, clipped = (
            play(Simulation(task, 1), each)[0] for each in (actions, np.clip(actions, -1, 1))
        )
        np.testing.assert_array_equal(wide, clipped)


class TestReset:
    def test_after_a_wild_episode_gives_the_first_episode_again(self, name):
        simulation = Simulation(TASKS[name](), 2)
        actions = make_actions("uniform", 100, simulation.task.n_actions)[:, None]
        first = play(simulation, actions)[0]
        play(simulation, np.ones((15, 1, simulation.task.n_actions)))
        assert np.abs(simulation._batch.qvel).max() > 0.1
        np.testing.assert_array_equal(play(simulation, actions)[0], first)

    def test_starts_without_success(self, name):
        simulation = Simulation(TASKS[name](), 2)
        simulation.reset()
        assert not simulation.task.success(simulation._observe(slice(None))).any()
        # Computing what derives from the start has left it alone, the solver's warm start too.
        np.testing.assert_array_equal(simulation._batch.state, np.stack([simulation._start] * 2))


class TestRandomStarts:
    N = 60

    def rngs(self):
        return [np.random.default_rng(seed) for seed in range(self.N)]

    def test_are_left_alone_by_what_derives_from_them(self, name):
        task = TASKS[name](random_start=True)
        simulation, starts = Simulation(task, self.N), RandomStarts(task)
        simulation.reset(rngs=self.rngs())
        expected = np.stack([starts.draw(rng) for rng in self.rngs()])
        np.testing.assert_array_equal(simulation.state, expected)
        assert len(np.unique(expected, axis=0)) == self.N

    def test_of_one_generator_are_the_same_for_all(self, name):
        simulation = Simulation(TASKS[name](random_start=True), 3)
        simulation.reset(rngs=self.rngs()[4:5])
        assert len(np.unique(simulation.state, axis=0)) == 1


def test_copies_continue_bit_for_bit_on_their_own(name, duplicate):
    simulation = Simulation(TASKS[name](), 2)
    actions = make_actions("bang-bang", 300, simulation.task.n_actions)[:, None]
    play(simulation, actions)
    twin = duplicate(simulation)
    np.testing.assert_array_equal(simulation.observations, twin.observations)
    np.testing.assert_array_equal(simulation.behaviors, twin.behaviors)
    for action in actions:
        np.testing.assert_array_equal(simulation.step(action), twin.step(action))
        np.testing.assert_array_equal(simulation.observations, twin.observations)
    twin.reset()
    assert (simulation.observations != twin.observations).any()


FORK = """
import gc, os, sys, time
import numpy as np
from curiosity_gym.control.control_env import ControlVectorEnv

envs = ControlVectorEnv("finger", num_envs=4, n_threads=2)
envs.reset()
for act in {acts}:
    child = os.fork()
    if child == 0:
        exec(act)
    deadline = time.monotonic() + 60
    while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < deadline:
        time.sleep(0.02)
    print(ended[0] == child, ended[1], flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_forked_processes_may_forget_what_they_inherited():
    acts = [
        "del envs; gc.collect(); os._exit(0)",
        "envs.close(); sys.exit(0)",
        "envs.step(np.zeros((4, 2))); sys.exit(0)",
        "envs.step(np.zeros((4, 2))); del envs; gc.collect(); sys.exit(0)",
    ]
    printed, complaint = run_without_display(FORK.format(acts=acts))
    assert (printed.split(), complaint) == (["True", "0"] * len(acts), "")
