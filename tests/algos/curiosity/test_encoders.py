import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from stable_baselines3.common.torch_layers import NatureCNN

from curiosity_algos.curiosity.encoders import ImageInputs, make_encoder


def images(*shape):
    return spaces.Box(0, 255, shape, np.uint8)


def generator(seed=0):
    return th.Generator().manual_seed(seed)


def test_numbers_are_no_images():
    assert ImageInputs.of(spaces.Box(-1, 1, (6,))) is None
    encoder = make_encoder(spaces.Box(-1, 1, (6,)), 8, 5, generator=generator())
    assert encoder(th.zeros(3, 6)).shape == (3, 5)


@pytest.mark.parametrize("shape", [(4, 84, 84), (84, 80, 4), (1, 36, 36)])
def test_images_are_sb3s_convolutions(shape):
    encoder = make_encoder(images(*shape), 64, 5, generator=generator())
    assert isinstance(encoder, NatureCNN)
    inputs = ImageInputs.of(images(*shape))
    picture = inputs.unflatten(inputs.flat(th.zeros(3, *shape, dtype=th.uint8)))
    assert encoder(picture).shape == (3, 5)


@pytest.mark.parametrize(("shape", "order"), [((3, 36, 40), (0, 1, 2)), ((36, 40, 3), (2, 0, 1))])
def test_colors_come_first_and_are_shares(shape, order):
    pixels = np.random.default_rng(0).integers(0, 256, (2, *shape), np.uint8)
    inputs = ImageInputs.of(images(*shape))
    seen = inputs.unflatten(inputs.flat(th.from_numpy(pixels)))
    expected = pixels.transpose(0, *(1 + axis for axis in order)) / 255
    np.testing.assert_allclose(seen, expected, rtol=1e-6)


def test_weights_are_the_generators():
    space, before = images(3, 36, 36), th.get_rng_state()
    one, same, other = (make_encoder(space, 5, generator=generator(i)) for i in (0, 0, 1))
    assert th.equal(before, th.get_rng_state())
    for a, b, c in zip(one.parameters(), same.parameters(), other.parameters(), strict=True):
        assert th.equal(a, b)
        assert not th.equal(a, c)


@pytest.mark.parametrize(
    ("space", "message"),
    [
        (spaces.Discrete(3), "one-dimensional Box, or one of images"),
        (spaces.Box(-1, 1, (3, 3)), "one-dimensional Box, or one of images"),
        (spaces.Box(0, 1, (3, 84, 84), np.float32), "one-dimensional Box, or one of images"),
        (images(3, 35, 84), "images of 36 by 36 at least"),
        (images(84, 35, 3), "images of 36 by 36 at least"),
    ],
)
def test_errors_say_what_observations_may_be(space, message):
    with pytest.raises(ValueError, match=f"`observation_space` must .*{message}"):
        make_encoder(space, 5, generator=generator())
