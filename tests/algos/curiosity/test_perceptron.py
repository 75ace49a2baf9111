import threading

import numpy as np
import pytest
import torch as th
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info

from curiosity_algos.common.networks import mlp
from curiosity_algos.curiosity.perceptron import (
    Layers,
    Pass,
    backward,
    forward,
    is_perceptron,
    set_gradients,
    single_blas_thread,
)


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


def test_layers_are_the_networks_own():
    network = mlp(3, 4, 2, generator=th.Generator().manual_seed(0))
    layers = Layers.of(network)
    with th.no_grad():
        network[2].weight.fill_(7.0)
    assert (layers.weights[1] == 7.0).all()
    assert layers.n_parameters == sum(each.numel() for each in network.parameters())


def test_slopes_become_the_gradients_of_an_optimizer():
    network = mlp(3, 4, 2, generator=th.Generator().manual_seed(0))
    slopes = np.arange(26, dtype=np.float32)
    set_gradients(th.optim.SGD(network.parameters()), slopes)
    np.testing.assert_array_equal(network[0].weight.grad.ravel(), slopes[:12])
    np.testing.assert_array_equal(network[2].bias.grad, slopes[24:])


def linear(n_in, n_out):
    return th.nn.Linear(n_in, n_out)


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        (th.nn.Sequential(linear(2, 3)), True),
        (th.nn.Sequential(linear(2, 3), th.nn.ReLU(), linear(3, 1)), True),
        (th.nn.Sequential(linear(2, 3), th.nn.Tanh(), linear(3, 1)), False),
        (th.nn.Sequential(linear(2, 3), th.nn.ReLU()), False),
        (th.nn.Sequential(linear(2, 3), linear(3, 1)), False),
        (th.nn.Sequential(th.nn.Sequential(linear(2, 3)), th.nn.ReLU(), linear(3, 1)), False),
        (th.nn.Identity(), False),
    ],
)
def test_what_is_a_perceptron(network, expected):
    assert is_perceptron(network) is expected


def test_products_take_one_thread_until_the_last_has_left():
    before = blas_threads()
    assert before
    entered, leave = threading.Event(), threading.Event()

    def enter():
        with single_blas_thread():
            entered.set()
            assert leave.wait(60)

    with single_blas_thread():
        other = threading.Thread(target=enter)
        other.start()
        assert entered.wait(60)
    assert set(blas_threads()) == {1}
    leave.set()
    other.join(60)
    assert blas_threads() == before


def test_an_error_gives_the_threads_back():
    before = blas_threads()
    with pytest.raises(RuntimeError), single_blas_thread():
        raise RuntimeError
    assert blas_threads() == before
