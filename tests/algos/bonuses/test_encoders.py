import math

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from stable_baselines3.common.torch_layers import NatureCNN

from curiosity_algos.bonuses.encoders import ActionEncoder, ImageInputs, SmallCNN, make_encoder
from curiosity_algos.bonuses.rnd import RND


def images(*shape):
    return spaces.Box(0, 255, shape, np.uint8)


def generator(seed=0):
    return th.Generator().manual_seed(seed)


@pytest.mark.parametrize("shape", [(4, 84, 84), (84, 80, 4), (1, 36, 36)])
def test_images_are_sb3s_convolutions(shape):
    encoder = make_encoder(images(*shape), 64, 5, generator=generator())
    assert isinstance(encoder, NatureCNN)
    inputs = ImageInputs.of(images(*shape))
    picture = inputs.unflatten(th.zeros(3, math.prod(shape)))
    assert encoder(picture).shape == (3, 5)


@pytest.mark.parametrize("shape", [(7, 7, 3), (3, 7, 9), (4, 4, 1), (3, 35, 84)])
def test_small_images_have_small_convolutions(shape):
    encoder = make_encoder(images(*shape), 64, 5, generator=generator())
    assert isinstance(encoder, SmallCNN)
    picture = ImageInputs.of(images(*shape)).unflatten(th.rand(3, math.prod(shape)))
    features = encoder(picture)
    assert features.shape == (3, 5)
    # Each is seen whole: a pixel in the last corner counts, too.
    picture[0, -1, -1, -1] += 10.0
    assert not th.equal(encoder(picture)[0], features[0])


def test_batches_of_small_images_may_be_standardized():
    pictures = 10.0 * th.rand(64, 3, 7, 7, generator=generator())
    encoder = SmallCNN(images(3, 7, 7), batch_norm=True)
    norms = [each for each in encoder.modules() if isinstance(each, th.nn.BatchNorm2d)]
    assert [each.num_features for each in norms] == [3, 16, 32, 64]
    encoder.train()
    np.testing.assert_allclose(
        encoder(pictures).detach(), encoder(5.0 * pictures + 7.0).detach(), atol=1e-3
    )
    encoder.eval()
    assert not th.allclose(encoder(pictures), encoder(5.0 * pictures + 7.0), atol=0.1)


@pytest.mark.parametrize(("shape", "order"), [((3, 36, 40), (0, 1, 2)), ((36, 40, 3), (2, 0, 1))])
def test_colors_come_first_and_are_shares(shape, order):
    pixels = np.random.default_rng(0).integers(0, 256, (2, *shape), np.uint8)
    bonus = RND(images(*shape), None, normalize=False, device="cpu")
    seen = bonus.inputs(th.from_numpy(pixels))
    expected = pixels.transpose(0, *(1 + axis for axis in order)) / 255
    np.testing.assert_allclose(seen, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("space", "message"),
    [
        (spaces.Discrete(3), "one-dimensional Box with an entry, or one of images"),
        (spaces.Box(0, 1, (3, 84, 84), np.float32), "or one of images"),
        (spaces.Box(-1, 1, (0,)), "one-dimensional Box with an entry"),
        (images(7, 7, 12), "fewer colors than pixels along a side below 36"),
        (images(84, 3, 4), "images of 4 by 4 at least"),
    ],
)
def test_errors_say_what_observations_may_be(space, message):
    with pytest.raises(ValueError, match=f"`observation_space` must .*{message}"):
        make_encoder(space, 5, generator=generator())


class TestActions:
    def encode(self, space, actions):
        return ActionEncoder(space)(th.tensor(actions, dtype=th.float32)).tolist()

    def test_each_entry_is_scaled_by_its_bounds(self):
        space = spaces.Box(np.float32([-0.25, 2.0]), np.float32([0.75, 10.0]))
        actions = [[-0.25, 2.0], [0.25, 6.0], [0.75, 10.0], [0.5, 8.0]]
        assert self.encode(space, actions) == [[-1, -1], [0, 0], [1, 1], [0.5, 0.5]]

    @pytest.mark.parametrize(("low", "high"), [(-np.inf, np.inf), (-3, np.inf), (-np.inf, 3)])
    def test_entries_that_lack_a_bound_stay_as_they_are(self, low, high):
        space = spaces.Box(np.float32([low, -4.0]), np.float32([high, 4.0]))
        assert self.encode(space, [[700.0, 2.0]]) == [[700.0, 0.5]]

    def test_an_entry_that_cannot_change_says_nothing(self):
        assert self.encode(spaces.Box(3.0, 3.0, (1,)), [[3.0]]) == [[0.0]]

    @pytest.mark.parametrize("shape", [(3,), (3, 1)])
    def test_discrete_ones_are_one_hot(self, shape):
        actions = np.reshape([2, 0, 1], shape)
        assert self.encode(spaces.Discrete(3), actions) == [[0, 0, 1], [1, 0, 0], [0, 1, 0]]

    def test_other_shapes_are_refused(self):
        with pytest.raises(ValueError, match="`actions` must have shape"):
            self.encode(spaces.Box(-1, 1, (3,)), [[1.0]])
