import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos import AURORA


def test_trainings_come_at_doubling_intervals_and_anew_in_another_env(make_model, make_maze):
    model, trained = make_model(AURORA, make_maze(), training_interval=3), []
    train = model._encoder.train
    model._encoder.train = lambda states: trained.append(model.generation) or train(states)
    model.learn(15 * 6 * 50)
    assert trained == [0, 3, 6, 12]
    model.set_env(make_maze(layout="snake"))
    model.learn(4 * 6 * 50, reset_num_timesteps=False)
    assert trained[4:] == [15, 18]


@pytest.mark.parametrize("length", [1, 2])
def test_the_shortest_episodes_are_told_apart(make_model, length):
    env = gym.make("Pendulum-v1", max_episode_steps=length)
    model = make_model(AURORA, env).learn(10 * 6 * length)
    assert model._encoder.shape == (2, 3)
    assert len(np.unique(model.archive.data("measures"), axis=0)) == len(model.archive) >= 20


def test_the_latent_space_is_encoded_anew_after_each_training(make_model, make_easy_maze):
    model = make_model(AURORA, make_easy_maze(), training_interval=1)
    latents = []
    for _ in range(4):
        model.learn(1, reset_num_timesteps=False)
        states, measures = model.archive.data("states"), model.archive.data("measures")
        np.testing.assert_allclose(measures, model._encoder.encode(states), rtol=1e-4, atol=1e-5)
        latents.append(measures[0])
    assert not np.allclose(latents[0], latents[1], rtol=1e-3)


def test_states_are_40_percent_of_the_elites_own_trajectories(make_model, make_easy_maze):
    model = make_model(AURORA, make_easy_maze()).learn(2000)
    assert model.archive.data("states").shape[1:] == (26, 36)  # of 64 steps
    elites = model.archive.data()
    for slot in range(len(model.archive)):
        rollouts = model.evaluator.evaluate(elites["solution"][[slot]], 0)
        expected = model._encoder.states(rollouts)[0]
        np.testing.assert_array_equal(elites["states"][slot], expected)


def test_it_begins_with_an_empty_archive(make_model, make_easy_maze):
    held = make_model(AURORA, make_easy_maze()).learn(2000).archive
    n_elites = len(held)
    with pytest.raises(ValueError, match=rf"^`archive` must be empty, .* got {n_elites} elites"):
        make_model(AURORA, make_easy_maze(), archive=held)
    assert len(held) == n_elites > 0
    held.clear()
    assert len(make_model(AURORA, make_easy_maze(), archive=held).learn(2000).archive) > 0
