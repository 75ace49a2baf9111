"""The benchmark of bonuses, whose actions are held by a wrapper of Gymnasium 1.3."""

import shutil

import pandas as pd
import pytest

pytest.importorskip("gymnasium", minversion="1.3")

from benchmarks import bonuses, results

pytestmark = pytest.mark.nightly


def train(name, folder, *, bonus="apt"):
    """The runs of a name that have a bonus, on US, for 2,000 steps."""
    runs = [run for run in bonuses.RUNS[name] if (run.env, run.bonus) == (bonuses.US, bonus)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(bonuses.RUNS, name, runs)
        bonuses.main(name, seeds="0", timesteps=2e3, runs=folder, jobs=1, out=folder)


def test_steps_of_held_actions_are_counted(tmp_path):
    for name in ("ppo_parts/power=1", "ppo_parts/num_repeats=1"):
        train(name, tmp_path)
    runs, curves = (pd.read_csv(tmp_path / f"ppo_parts{kind}.csv") for kind in ("", "_curves"))
    labels = ["PPO + APT, num_repeats=1", "PPO + APT, power=1"]
    assert runs["algorithm"].tolist() == labels
    assert runs["timesteps"].tolist() == [2048, 10240]
    assert curves.groupby("algorithm")["timesteps"].max().tolist() == [2048, 10240]
    written = (tmp_path / "ppo_parts.csv").read_text()
    shutil.rmtree(tmp_path / "ppo_parts" / "num_repeats=1")
    results.collect(tmp_path / "ppo_parts", "ppo_parts", tmp_path)  # the others stay
    assert (tmp_path / "ppo_parts.csv").read_text() == written


def test_off_policy_algorithms_stand_beside_a_stored_bonus(tmp_path):
    for name, bonus in {"sac": "apt", "td3": None, "stored": "apt"}.items():
        train(f"off_policy/{name}", tmp_path, bonus=bonus)
    runs = pd.read_csv(tmp_path / "off_policy.csv")
    assert runs["algorithm"].tolist() == ["SAC + APT", "SAC + APT, stored", "TD3"]
    assert runs["timesteps"].tolist() == [2560, 2560, 2560]


def test_processes_of_a_sweep_can_import_every_run():
    modules = {type(run).__module__ for runs in bonuses.RUNS.values() for run in runs}
    assert bonuses.__name__ not in modules  # which is `__main__` where it is started
