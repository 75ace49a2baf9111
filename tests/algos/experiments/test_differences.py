import pytest

from curiosity_algos.experiments.differences import check_same

THERE = {"algorithm": "NSES", "env": "A-v0", "seed": 0, "settings": {"k": None, "sigma": 0.5}}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, None),
        ({"settings": {"sigma": 0.5, "k": None, "device": "cuda", "verbose": 2}}, None),
        ({"versions": {"numpy": "9"}, "vec_env": None}, None),
        ({"seed": 1}, "seed is 0, not 1"),
        ({"seed": 1, "env": "B-v0"}, 'env is "A-v0", not "B-v0"'),
        ({"wrappers": {"Flatten": {}}}, "wrappers.Flatten is null, not {}"),
        ({"settings": {"sigma": 0.5, "k": 3}}, "settings.k is null, not 3"),
        ({"num_timesteps": 5}, "num_timesteps is null, not 5"),
    ],
)
def test_the_first_value_that_differs_is_named(changes, message, tmp_path):
    there = THERE | {"wrappers": {}}
    if message is None:
        check_same(tmp_path, there, there | changes)
        return
    with pytest.raises(ValueError, match="must be empty or that of") as raised:
        check_same(tmp_path, there, there | changes)
    assert str(raised.value).endswith(f": in {tmp_path} {message}.")
