import numpy as np
import pytest
import torch as th
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_algos.common.networks import RunningNormalizer, torch_device


@settings(deadline=None)
@given(
    st.lists(st.integers(1, 20), min_size=1, max_size=6),
    st.integers(0, 2**31),
    st.floats(-100, 100),
    st.floats(0.01, 100),
)
def test_statistics_equal_numpys_over_all_batches(sizes, seed, shift, scale):
    rng = np.random.default_rng(seed)
    # The first is large enough to know the deviation: from two alike on, a third would be bounded.
    batches = [shift + scale * rng.standard_normal((n, 3)) for n in (10, *sizes)]
    normalizer = RunningNormalizer(3)
    for batch in batches:
        normalizer.observe(th.from_numpy(batch))
    everything = np.concatenate(batches)
    np.testing.assert_allclose(normalizer.mean, everything.mean(0), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(normalizer.variance, everything.var(0), rtol=1e-7, atol=1e-9)
    assert normalizer.count == len(everything)
    new = everything[:5].astype(np.float32)
    expected = (new - everything.mean(0)) / np.maximum(everything.std(0), 1e-3)
    tolerance = 1e-4 * (1 + abs(shift)) / max(everything.std(0).min(), 1e-3)
    np.testing.assert_allclose(
        normalizer(th.from_numpy(new)), np.clip(expected, -5, 5), atol=tolerance
    )


def test_many_are_observed_in_parts(monkeypatch):
    monkeypatch.setattr("curiosity_algos.common.networks.N_OBSERVED", 4)
    seen = np.random.default_rng(0).normal(3, 2, (11, 2))
    normalizer = RunningNormalizer(2)
    normalizer.observe(th.from_numpy(seen))
    assert normalizer.count == 11
    np.testing.assert_allclose(normalizer.mean, seen.mean(0), rtol=1e-12)
    np.testing.assert_allclose(normalizer.variance, seen.var(0), rtol=1e-12)


def test_a_constant_feature_stays_finite_and_bounded():
    normalizer = RunningNormalizer(2)
    normalizer.observe(th.tensor([[0.1, 1.0], [0.1, -1.0], [0.1, 0.0]]))
    out = normalizer(th.tensor([[0.1, 0.0], [7.0, 0.0]]))
    assert th.isfinite(out).all()
    assert abs(out[0, 0]) < 1e-3
    assert out[1, 0] == RunningNormalizer.CLIP


@pytest.mark.parametrize("device", [3.5, "nope", None, th.float32])
def test_a_device_is_one_of_torchs(device):
    assert torch_device("cpu") == torch_device(th.device("cpu")) == th.device("cpu")
    with pytest.raises(ValueError, match="`device` must be"):
        torch_device(device)


@pytest.mark.skipif(th.cuda.is_available(), reason="there is a GPU")
def test_a_gpu_that_is_not_there_is_not_the_processor():
    assert torch_device("auto") == th.device("cpu")
    with pytest.raises(ValueError, match="`device` must be"):
        torch_device("cuda")


def test_one_observation_like_no_other_moves_the_deviation_by_a_small_factor():
    rows = th.randn(4000, 2, generator=th.Generator().manual_seed(0))
    spared, moved = RunningNormalizer(2), RunningNormalizer(2)
    for part in rows.split(16):
        spared.observe(part)
        moved.observe(part)
    moved.observe(th.tensor([[1e6, 0.0]]))
    ratio = (moved.variance / spared.variance).sqrt()
    assert 1.0 < ratio[0] < 2.5
    assert ratio[1] == pytest.approx(1.0, abs=1e-3)


def test_what_was_constant_may_change_as_far_as_it_does():
    normalizer = RunningNormalizer(1)
    normalizer.observe(th.zeros(99, 1))
    normalizer.observe(th.ones(1, 1))
    assert normalizer.variance.item() == pytest.approx(0.0099)
    normalizer.observe(th.ones(1, 1))  # once more is nothing new
    assert normalizer.mean.item() == pytest.approx(2 / 101)
