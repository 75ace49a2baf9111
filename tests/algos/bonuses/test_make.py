import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.bonuses.e3b import Ellipsoids
from curiosity_algos.bonuses.encoders import action_size
from curiosity_algos.bonuses.make import (
    BONUSES,
    check_bonus_choice,
    make_bonus,
)

SPACES = spaces.Box(-1, 1, (4,)), spaces.Box(-1, 1, (2,))
SEED = np.random.SeedSequence(1)


@pytest.mark.parametrize(
    ("space", "encoded"), [(spaces.Discrete(4), 4), (spaces.Box(-1, 1, (3,)), 3)]
)
def test_an_action_has_its_numbers(space, encoded):
    assert action_size(space) == encoded


@pytest.mark.parametrize(
    "space",
    [spaces.MultiDiscrete([2, 2]), spaces.Discrete(3, start=1), spaces.Box(-1, 1, (2, 2))],
    ids=str,
)
def test_other_actions_are_refused(space):
    with pytest.raises(ValueError, match="`action_space` must be a one-dimensional Box"):
        make_bonus("rnd", {}, SPACES[0], space, seed=SEED, device="cpu")


@pytest.mark.parametrize("name", BONUSES)
def test_a_name_makes_a_bonus(name):
    bonus = make_bonus(name, {"n_features": 3}, *SPACES, seed=SEED, device="cpu")
    same = make_bonus(name, {"n_features": 3}, *SPACES, seed=SEED, device="cpu")
    trajectory = np.eye(3, 4, dtype=np.float32), np.ones((2, 2), np.float32)
    assert bonus.name == name
    scores = [each.score_trajectory(*trajectory) for each in (bonus, same)]
    np.testing.assert_array_equal(*scores)


def test_an_object_is_taken_as_it_is():
    bonus = make_bonus("rnd", {}, *SPACES, seed=SEED, device="cpu")
    check_bonus_choice(bonus, {})
    other = np.random.SeedSequence(2)
    assert make_bonus(bonus, {}, *SPACES, seed=other, device="cpu") is bonus


@pytest.mark.parametrize(
    "others",
    [(spaces.Box(-1, 1, (5,)), SPACES[1]), (SPACES[0], spaces.Box(-1, 1, (3,)))],
    ids=["observations", "actions"],
)
def test_an_object_for_other_spaces_is_refused(others):
    bonus = make_bonus("icm", {}, *others, seed=SEED, device="cpu")
    with pytest.raises(ValueError, match="`bonus` must score transitions of the env"):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


@pytest.mark.parametrize("horizon", [0, -3, 2.7, None, True])
def test_an_object_has_a_horizon_of_steps(horizon):
    bonus = make_bonus("apt", {}, *SPACES, seed=SEED, device="cpu")
    vars(bonus)["horizon"] = horizon  # as one of a user's own may have it
    with pytest.raises(ValueError, match="`bonus` must have a `horizon` of at least 1 step"):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


@pytest.mark.parametrize("missing", ["end", "state_dict", "load_state_dict"])
def test_an_object_with_a_memory_is_tried_out_whole(missing, monkeypatch):
    bonus = make_bonus("e3b", {}, *SPACES, seed=SEED, device="cpu")
    monkeypatch.delattr(Ellipsoids, missing)
    with pytest.raises(ValueError, match=r"`bonus\.episodes` must make what can end"):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


def test_an_object_for_more_actions_is_refused():
    bonus = make_bonus("icm", {}, *SPACES, seed=SEED, device="cpu")
    with pytest.raises(ValueError, match="`bonus` must score transitions of the env"):
        make_bonus(bonus, {}, SPACES[0], spaces.Box(-1, 1, (1,)), seed=SEED, device="cpu")


@pytest.mark.parametrize("bonus", BONUSES)
def test_an_object_for_images_of_another_layout_is_refused(bonus):
    last, first = (spaces.Box(0, 255, shape, np.uint8) for shape in ((36, 40, 3), (3, 36, 40)))
    bonus = make_bonus(bonus, {}, last, SPACES[1], seed=SEED, device="cpu")
    assert make_bonus(bonus, {}, last, SPACES[1], seed=SEED, device="cpu") is bonus
    with pytest.raises(ValueError, match="`bonus` must score transitions of the env"):
        make_bonus(bonus, {}, first, SPACES[1], seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("made", "asked"),
    [
        (spaces.Discrete(2), spaces.Discrete(3)),
        (spaces.Box(-1, 1, (1,)), spaces.Discrete(2)),
        (spaces.Discrete(2), spaces.Box(-1, 1, (1,))),
    ],
)
def test_an_object_for_actions_of_another_kind_is_refused(made, asked):
    bonus = make_bonus("icm", {}, SPACES[0], made, seed=SEED, device="cpu")
    assert make_bonus(bonus, {}, SPACES[0], made, seed=SEED, device="cpu") is bonus
    with pytest.raises(ValueError, match="`bonus` must score transitions of the env"):
        make_bonus(bonus, {}, SPACES[0], asked, seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("space", "actions"),
    [
        (spaces.Box(-1, 1, (2,)), [[-1, -1], [1, 1]]),
        (spaces.Box(np.float32([2, -300]), np.float32([5, 7])), [[2, -1], [2, 1]]),
        (spaces.Box(-np.inf, np.inf, (1,)), [[-1], [1]]),
        (spaces.Box(-np.inf, -8, (1,)), [[-8], [-8]]),
        (spaces.Box(8, np.inf, (1,)), [[8], [8]]),
        (spaces.Discrete(3), [0, 2]),
    ],
    ids=str,
)
def test_an_object_is_tried_out_on_actions_of_the_environment(space, actions):
    bonus = make_bonus("icm", {}, SPACES[0], space, seed=SEED, device="cpu")
    asked, score = [], bonus.score
    bonus.score = lambda *batch: asked.append(batch[1]) or score(*batch)
    make_bonus(bonus, {}, SPACES[0], space, seed=SEED, device="cpu")
    np.testing.assert_array_equal(asked, [actions])
    assert all(space.contains(action) for action in asked[0])


def test_an_object_that_could_not_be_saved_is_refused():
    bonus = make_bonus("icm", {}, *SPACES, seed=SEED, device="cpu")
    bonus.state_dict = lambda: {"counts": {1}}
    with pytest.raises(ValueError, match=r"A state must hold .* at `bonus/"):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


def test_an_object_gives_each_transition_one_score():
    bonus = make_bonus("icm", {}, *SPACES, seed=SEED, device="cpu")
    bonus.score = lambda observations, actions, next_observations: np.zeros((2, 1))
    with pytest.raises(ValueError, match=r"`bonus` must give one score .*, got \(2, 1\) of 2"):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("bonus", "name", "value"),
    [
        *[
            (bonus, name, value)
            for bonus in BONUSES
            for name, value in [
                ("seed", "a"),
                ("normalize", "no"),
                ("learning_rate", 0.0),
                ("n_features", 0),
                ("hidden", 0),
            ]
        ],
        ("apt", "n_neighbors", 0),
        ("apt", "horizon", 0),
        ("apt", "power", 0.0),
        ("icm", "beta", 1.1),
        ("icm", "hidden", 1.5),
        ("icm", "device", "nope"),
        ("noveld", "alpha", -1.0),
        ("noveld", "beta", np.nan),
        ("noveld", "n_bits", 63),
    ],
)
def test_arguments_are_named(bonus, name, value):
    with pytest.raises(ValueError, match=f"`{name}` must be"):
        BONUSES[bonus](*SPACES, **{"device": "cpu", name: value})


@pytest.mark.parametrize("bonus_kwargs", [3, ["beta"], {"beta": 0.1, 3: 4}])
def test_keywords_are_those_of_the_bonus(bonus_kwargs):
    with pytest.raises(ValueError, match="`bonus_kwargs` must be"):
        check_bonus_choice("icm", bonus_kwargs)


@pytest.mark.parametrize("bonus", ["count", None, 3, BONUSES["icm"], object()], ids=type)
def test_anything_else_is_no_bonus(bonus):
    with pytest.raises(
        ValueError,
        match="`bonus` must be one of apt, disagreement, e3b, icm, ngu, noveld, ramp, rnd",
    ):
        check_bonus_choice(bonus, {})
