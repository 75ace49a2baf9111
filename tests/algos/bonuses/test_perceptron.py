import threading

import numpy as np
import pytest
import torch as th
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits

from curiosity_algos.bonuses.perceptron import (
    Layers,
    Pass,
    backward,
    blas_limit,
    forward,
    single_blas_thread,
)
from curiosity_algos.common.networks import mlp


def blas_threads():
    return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]


@settings(deadline=None)
@given(
    sizes=st.lists(st.integers(1, 40), min_size=2, max_size=5),
    n=st.integers(1, 70),
    spare=st.integers(0, 3),
    seed=st.integers(0, 2**32 - 1),
)
def test_it_gives_the_outputs_and_slopes_of_autograd(sizes, n, spare, seed):
    generator = th.Generator().manual_seed(seed)
    network = mlp(*sizes, generator=generator)
    inputs = th.randn(n, sizes[0], generator=generator, requires_grad=True)
    by_outputs = th.randn(n, sizes[-1], generator=generator)
    outputs = network(inputs)
    outputs.backward(by_outputs)

    layers, x = Layers.of(network), inputs.detach().numpy()
    held = Pass.of(layers, n + spare)
    forward(layers, x, held.outputs)
    held.slopes[-1][:n] = by_outputs.numpy()
    slopes, by_inputs = np.full(layers.n_parameters, np.nan, np.float32), np.full_like(x, np.nan)
    backward(layers, x, held, slopes, by_inputs)

    close = {"rtol": 1e-5, "atol": 1e-5}
    np.testing.assert_allclose(held.outputs[-1][:n], outputs.detach().numpy(), **close)
    np.testing.assert_allclose(by_inputs, inputs.grad.numpy(), **close)
    expected = np.concatenate([each.grad.numpy().ravel() for each in network.parameters()])
    np.testing.assert_allclose(slopes, expected, **close)


def linear(n_in, n_out, **settings):
    return th.nn.Linear(n_in, n_out, **settings)


def changed(change):
    network = th.nn.Sequential(linear(2, 3), th.nn.ReLU(), linear(3, 1))
    change(network)
    return network


RELU = th.nn.ReLU()


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        (th.nn.Sequential(linear(2, 3), RELU, linear(3, 1)), 2),
        (th.nn.Sequential(linear(2, 3), RELU, linear(3, 4), RELU, linear(4, 1)), 3),
        (th.nn.Sequential(linear(2, 3), th.nn.Tanh(), linear(3, 1)), None),
        (th.nn.Sequential(linear(2, 3), RELU), None),
        (th.nn.Sequential(linear(2, 3), linear(3, 1)), None),
        (th.nn.Sequential(), None),
        (th.nn.Sequential(linear(2, 3, bias=False)), None),
        (th.nn.Sequential(linear(2, 3, device="meta")), None),
        (changed(lambda network: network[0].requires_grad_(False)), None),
    ],
)
def test_what_is_nothing_but_layers(network, expected):
    layers = Layers.of(network)
    assert (None if layers is None else len(layers.weights)) == expected


@pytest.fixture
def _two_threads():
    with threadpool_limits(2, user_api="blas"):
        yield


@pytest.mark.usefixtures("_two_threads")
def test_products_take_one_thread_whatever_other_threads_enter():
    before = blas_threads()
    assert set(before) == {2}

    def enter():
        with blas_limit():
            pass

    with single_blas_thread():
        assert set(blas_threads()) == {1}
        other = threading.Thread(target=enter)
        other.start()
        other.join(60)
        enter()
        assert set(blas_threads()) == {1}
    assert blas_threads() == before
