"""The benchmark of bonuses, whose actions are held by a wrapper of Gymnasium 1.3."""

import shutil

import pandas as pd
import pytest

pytest.importorskip("gymnasium", minversion="1.3")

from benchmarks import bonuses, results


def test_steps_of_held_actions_are_counted(tmp_path):
    for name in ("ppo_parts/power=1", "ppo_parts/num_repeats=1"):
        bonuses.train(name, f"apt/{bonuses.US}", 0, 2e3, tmp_path)
    results.collect(tmp_path / "ppo_parts", "parts", tmp_path)
    runs, curves = (pd.read_csv(tmp_path / f"parts{kind}.csv") for kind in ("", "_curves"))
    labels = ["PPO + APT, num_repeats=1", "PPO + APT, power=1"]
    assert runs["algorithm"].tolist() == labels
    assert runs["timesteps"].tolist() == [2048, 10240]
    assert curves.groupby("algorithm")["timesteps"].max().tolist() == [2048, 10240]
    written = (tmp_path / "parts.csv").read_text()
    shutil.rmtree(tmp_path / "ppo_parts" / "num_repeats=1")
    results.collect(tmp_path / "ppo_parts", "parts", tmp_path)  # the others stay
    assert (tmp_path / "parts.csv").read_text() == written


def test_off_policy_algorithms_stand_beside_a_stored_bonus(tmp_path):
    us = bonuses.US
    runs = {"sac": f"apt {us}", "td3": f"None {us}", "stored": f"apt/{us}"}
    for name, variant in runs.items():
        bonuses.train(f"off_policy/{name}", variant, 0, 2e3, tmp_path)
    results.collect(tmp_path / "off_policy", "off_policy", tmp_path)
    runs = pd.read_csv(tmp_path / "off_policy.csv")
    assert runs["algorithm"].tolist() == ["SAC + APT", "SAC + APT, stored", "TD3"]
    assert runs["timesteps"].tolist() == [2560, 2560, 2560]
