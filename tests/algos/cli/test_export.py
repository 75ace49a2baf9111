"""`curiosity export`."""

import pytest

from curiosity_algos import CanonicalES
from curiosity_algos.experiments import SaveRun


@pytest.fixture
def run(tmp_path, make_model):
    make_model(CanonicalES, "CartPole-v1").learn(1, SaveRun(tmp_path / "run"))
    return "run"


@pytest.mark.extra("minari")
def test_a_dataset(run, run_here, refused, tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    words = ["export", run, "--to", "minari", "--out", "cart/pole-v0", "--policies", "sample"]
    status, printed, errors = run_here(*words, "--n-policies", "2")
    assert status == 0, errors
    assert printed.startswith("2 episodes, ")
    assert printed.endswith(" steps: cart/pole-v0\n")
    assert (tmp_path / "datasets" / "cart" / "pole-v0" / "data").is_dir()
    assert "`out` must be a new dataset" in refused(*words)


@pytest.mark.extra("onnx")
def test_a_policy(run, run_here, refused, tmp_path):
    assert run_here("export", run, "--to", "onnx", "--out", "best.onnx") == (0, "best.onnx\n", "")
    assert (tmp_path / "best.onnx").stat().st_size > 100
    assert "`out` must end in .onnx" in refused("export", run, "--to", "onnx", "--out", "best")
    for words in (["--policies", "elites"], ["--n-policies", "3"]):
        said = refused("export", run, "--to", "onnx", "--out", "best.onnx", *words)
        assert "must be left out with --to onnx" in said


def test_a_wrong_target(run, refused):
    assert "`to` must be " in refused("export", run, "--to", "csv", "--out", "a")
