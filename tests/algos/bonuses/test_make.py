import numpy as np
import pytest
from gymnasium import spaces

from curiosity_algos.bonuses.make import BONUSES, check_bonus_choice, make_bonus

SPACES = spaces.Box(-1, 1, (4,)), spaces.Box(-1, 1, (2,))
IMAGES = [spaces.Box(0, 255, shape, np.uint8) for shape in ((36, 40, 3), (3, 36, 40))]
SEED = np.random.SeedSequence(1)


@pytest.mark.parametrize(
    "space",
    [spaces.MultiDiscrete([2, 2]), spaces.Discrete(3, start=1), spaces.Box(-1, 1, (2, 2))],
    ids=str,
)
def test_other_actions_are_refused(space):
    with pytest.raises(ValueError, match="`action_space` must be a one-dimensional Box"):
        make_bonus("rnd", {}, SPACES[0], space, seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("made", "asked"),
    [
        ((spaces.Box(-1, 1, (5,)), SPACES[1]), SPACES),
        ((SPACES[0], spaces.Box(-1, 1, (3,))), SPACES),
        (SPACES, (SPACES[0], spaces.Box(-1, 1, (1,)))),
        ((SPACES[0], spaces.Discrete(2)), (SPACES[0], spaces.Discrete(3))),
        ((SPACES[0], spaces.Discrete(2)), (SPACES[0], spaces.Box(-1, 1, (1,)))),
        ((IMAGES[0], SPACES[1]), (IMAGES[1], SPACES[1])),
    ],
    ids=str,
)
def test_an_object_for_other_spaces_is_refused(made, asked):
    bonus = make_bonus("icm", {}, *made, seed=SEED, device="cpu")
    assert make_bonus(bonus, {}, *made, seed=SEED, device="cpu") is bonus
    with pytest.raises(ValueError, match="`bonus` must score transitions of the env"):
        make_bonus(bonus, {}, *asked, seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        *(("horizon", n, "`horizon` must be a whole number of at least 1") for n in (0, 2.7)),
        ("state_dict", lambda: {"counts": {1}}, r"A state must hold .* at `bonus/"),
        ("score", lambda *batch: np.zeros((2, 1)), r"`bonus` must give one .*, got \(2, 1\) of 2"),
    ],
)
def test_an_object_that_does_not_fit_is_refused(name, value, message):
    bonus = make_bonus("apt", {}, *SPACES, seed=SEED, device="cpu")
    vars(bonus)[name] = value  # as one of a user's own may have it
    with pytest.raises(ValueError, match=message):
        make_bonus(bonus, {}, *SPACES, seed=SEED, device="cpu")


@pytest.mark.parametrize(
    ("space", "actions"),
    [
        (spaces.Box(-1, 1, (2,)), [[-1, -1], [1, 1]]),
        (spaces.Box(np.float32([2, -300]), np.float32([5, np.inf])), [[2, -1], [2, 1]]),
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


@pytest.mark.parametrize(
    ("bonus", "name", "value"),
    [
        ("rnd", "seed", "a"),
        ("rnd", "normalize", "no"),
        ("rnd", "learning_rate", 0.0),
        ("rnd", "n_features", 0),
        ("apt", "n_neighbors", 0),
        ("apt", "horizon", 0),
        ("apt", "power", 0.0),
        ("icm", "beta", 1.1),
        ("disagreement", "n_models", 1),
        ("e3b", "ridge", 0.0),
        ("e3b", "log", 1),
        ("etd", "horizon", 0),
        ("icm", "hidden", 1.5),
        ("icm", "device", "nope"),
        ("ngu", "n_neighbors", 64),
        ("noveld", "alpha", -1.0),
        ("noveld", "beta", np.nan),
        ("noveld", "n_bits", 63),
        ("ramp", "n_newest", 0),
    ],
)
def test_arguments_are_named(bonus, name, value):
    with pytest.raises(ValueError, match=f"`{name}` must be"):
        BONUSES[bonus](*SPACES, **{"device": "cpu", name: value})


@pytest.mark.parametrize("bonus", ["count", None, 3, BONUSES["icm"], object()], ids=type)
def test_anything_else_is_no_bonus(bonus):
    with pytest.raises(
        ValueError,
        match="`bonus` must be one of apt, disagreement, e3b, etd, icm, ngu, noveld, ramp, rnd",
    ):
        check_bonus_choice(bonus, {})
