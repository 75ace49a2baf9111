import numpy as np
import pytest

from curiosity_algos import NSES

FINAL = {"behavior": "final"}


@pytest.mark.parametrize(
    "changes", [{"phi": 0.0}, {"k": 1}, {"behavior": "state"}, {"no_reward": "random"}], ids=str
)
def test_every_setting_has_an_effect(make_model, make_easy_maze, make_maze, changes):
    make = make_maze if "no_reward" in changes else make_easy_maze
    settings = {"phi": 0.5, "seed": 2, **FINAL}
    plain = make_model(NSES, make(), **settings).learn(3000)
    changed = make_model(NSES, make(), **(settings | changes)).learn(3000)
    assert not np.array_equal(plain._search.center, changed._search.center)


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


def test_errors_name_the_argument(make_model, make_maze):
    for name, value in {"k": 0, "behavior": "last"}.items():
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            make_model(NSES, make_maze(), **{name: value})
