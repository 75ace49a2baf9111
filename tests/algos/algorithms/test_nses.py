import pytest

from curiosity_algos import NSES

FINAL = {"behavior": "final"}


def test_every_individual_enters_the_archive(make_model, make_maze):
    model = make_model(NSES, make_maze(), **FINAL).learn(3 * 6 * 50)
    assert len(model._motivation.archive) == 3 * 6


def test_another_maze_has_other_behaviors(make_model, make_maze):
    model = make_model(NSES, make_maze(), **FINAL).learn(6 * 50)
    model.set_env(make_maze())
    assert len(model._motivation.archive) == 6
    model.set_env(make_maze(layout="snake"))
    assert len(model._motivation.archive) == 0


def test_final_behaviors_need_an_env_that_has_them(make_model):
    with pytest.raises(ValueError, match='`behavior="final"` needs an env'):
        make_model(NSES, "CartPole-v1", **FINAL)
