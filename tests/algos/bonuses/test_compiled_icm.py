import threading

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from hypothesis import given, settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_info, threadpool_limits
from torch.nn import Linear, ReLU, Tanh

from curiosity_algos.bonuses.base import NetworkBonus
from curiosity_algos.bonuses.compiled_icm import (
    N_ROWS,
    Layers,
    Pass,
    backward,
    blas_limit,
    forward,
    norms,
    single_blas_thread,
)
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.common.networks import mlp
from curiosity_gym.compiled import ThreadPool

BOX = spaces.Box(-2, 2, (3,))


def make_icm(cls=ICM, action_space=BOX, n_entries=5, **changes):
    given = {"n_features": 4, "hidden": 8, "seed": 0, "device": "cpu"} | changes
    icm = cls(spaces.Box(-1, 1, (n_entries,)), action_space, **given)
    icm.observe(make_batch(50, n_entries)[0])
    return icm


def make_batch(n, n_entries=5, seed=0):
    rng = th.Generator().manual_seed(seed)
    actions = th.rand(n, 3, generator=rng) * 4 - 2
    before, after = th.randn(2, n, n_entries, generator=rng)
    return before, actions, after


def gradients(icm):
    trained = icm.optimizer.param_groups[0]["params"]
    return np.concatenate([each.grad.numpy().ravel() for each in trained])


@given(
    n=st.integers(1, 3 * N_ROWS),
    sizes=st.tuples(*[st.integers(1, 20)] * 3),
    beta=st.sampled_from([0.0, 0.2, 1.0]),
    seed=st.integers(0, 1000),
)
def test_losses_and_slopes_are_those_of_autograd(n, sizes, beta, seed):
    n_entries, n_features, hidden = sizes
    made = {"n_features": n_features, "hidden": hidden, "beta": beta, "seed": seed}
    icm = make_icm(n_entries=n_entries, **made)
    batch = make_batch(n, n_entries, seed)
    expected = NetworkBonus.differentiate(icm, *batch)
    slopes = gradients(icm)
    assert icm.differentiate(*batch) == pytest.approx(expected, rel=1e-5, abs=1e-6)
    np.testing.assert_allclose(gradients(icm), slopes, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("n", [1, N_ROWS, N_ROWS + 1, 5 * N_ROWS - 7])
def test_bits_do_not_depend_on_the_number_of_threads(n):
    icm, batch = make_icm(), make_batch(n)
    seen = []
    for n_threads in (1, 2, 3, 8):
        icm.pool = ThreadPool(n_threads)
        seen.append((icm.differentiate(*batch), gradients(icm)))
    for losses, slopes in seen[1:]:
        assert losses == seen[0][0]
        np.testing.assert_array_equal(slopes, seen[0][1])


def test_where_a_norm_is_zero_so_are_its_slopes():
    same, slopes = np.ones((2, 3), np.float32), np.full((2, 3), np.nan, np.float32)
    assert norms(same, same, 1.0, slopes) == 0.0
    np.testing.assert_array_equal(slopes, 0.0)


def test_equations_of_a_subclass_are_its_own():
    class Doubled(ICM):
        def action_error(self, *args):
            return 2.0 * super().action_error(*args)

    batch = make_batch(20)
    plain, doubled = (make_icm(cls).differentiate(*batch) for cls in (ICM, Doubled))
    assert doubled["inverse_loss"] == pytest.approx(2.0 * plain["inverse_loss"], rel=1e-5)


def test_what_a_user_freezes_stays():
    icm = make_icm()
    icm.encoder.requires_grad_(False)
    before = icm.encoder[0].weight.clone()
    icm.update(*make_batch(20))
    assert th.equal(icm.encoder[0].weight, before)


@pytest.mark.parametrize(("n", "n_actions"), [(10, 7), (7, 10)])
def test_as_many_actions_as_transitions_are_asked_for(n, n_actions):
    icm, (before, _, after) = make_icm(), make_batch(n)
    actions = make_batch(n_actions)[1]
    with pytest.raises(ValueError, match="`actions` must be as many"):
        icm.update(before, actions, after)


def test_the_order_of_an_array_in_memory_does_not_matter():
    icm, batch = make_icm(normalize=False), make_batch(20)
    other = [each.T.contiguous().T for each in batch]
    assert icm.differentiate(*batch) == icm.differentiate(*other)


def test_what_is_compiled():
    assert make_icm()._compiled() is not None
    assert make_icm(type("Subclass", (ICM,), {}))._compiled() is None
    assert make_icm(action_space=spaces.Discrete(3))._compiled() is None


def blas_threads():
    return [each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"]


@settings(deadline=None)
@given(
    sizes=st.lists(st.integers(1, 40), min_size=2, max_size=5),
    n=st.integers(1, 70),
    spare=st.integers(0, 3),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_network_gives_the_outputs_and_slopes_of_autograd(sizes, n, spare, seed):
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


@pytest.mark.parametrize(
    ("network", "expected"),
    [
        ([Linear(2, 3), ReLU(), Linear(3, 1)], 2),
        ([Linear(2, 3), ReLU(), Linear(3, 4), ReLU(), Linear(4, 1)], 3),
        ([Linear(2, 3), Tanh(), Linear(3, 1)], None),
        ([Linear(2, 3), ReLU()], None),
        ([Linear(2, 3), Linear(3, 1)], None),
        ([], None),
        ([Linear(2, 3, bias=False)], None),
        ([Linear(2, 3, device="meta")], None),
        ([Linear(2, 3).requires_grad_(False), ReLU(), Linear(3, 1)], None),
    ],
)
def test_what_is_nothing_but_layers(network, expected):
    layers = Layers.of(th.nn.Sequential(*network))
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
