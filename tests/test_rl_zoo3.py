"""rl-zoo3 trains on our environments, and with our algorithms."""

import inspect
import operator
import runpy
import sys
from types import ModuleType

import gymnasium as gym
import numpy as np
import optuna
import pandas as pd
import pytest
from scripts import ROOT, run_script
from stable_baselines3.common.base_class import BaseAlgorithm

import curiosity_algos
from curiosity_algos import CuriosityES
from curiosity_algos.common.names import ALGORITHMS, find_algorithm

pytestmark = pytest.mark.nightly
EXAMPLES = ROOT / "examples"
SCRIPT = EXAMPLES / "rl_zoo3_train.py"
CONF_FILE = ["--conf-file", str(EXAMPLES / "rl_zoo3.yml")]
SPACES, convert, sampler = operator.itemgetter("SPACES", "convert", "sampler")(
    runpy.run_path(str(EXAMPLES / "rl_zoo3_spaces.py"))
)
ENV = "CuriosityMaze-US-v0"
GENERATION = 56 * 2000
"""Timesteps of a generation of CuriosityES while no individual is at the goal."""


def words(options):
    """A command line's, of options by their names."""
    return [word for name, value in options.items() for word in (f"--{name}", str(value))]


def train(folder, *arguments):
    """The model file of a run of CuriosityES by rl-zoo3."""
    options = {"algo": "CuriosityES", "env": ENV, "n-timesteps": 1000, "eval-freq": -1, "seed": 0}
    options |= {"device": "cpu", "log-folder": folder}
    run_script(SCRIPT, folder, [*CONF_FILE, *arguments, *words(options)])
    run = max((folder / "CuriosityES").glob(f"{ENV}_*"))
    return run / f"{ENV}.zip"


def test_the_example_trains_curiosity_es_and_goes_on(tmp_path):
    path = train(tmp_path)
    model = CuriosityES.load(path)
    assert model.num_timesteps == GENERATION
    assert model.coverage == CuriosityES(ENV, seed=0).learn(1000).coverage > 0.0

    resumed = train(tmp_path, "--trained-agent", str(path))
    assert resumed != path
    assert CuriosityES.load(resumed).generation == 2


def test_the_example_adds_every_algorithm_before_arguments_are_read(monkeypatch):
    seen = {}
    zoo = ModuleType("rl_zoo3.train")  # rl-zoo3 itself patches Gymnasium as it is imported
    zoo.ALGOS, zoo.train = {}, lambda: seen.update(zoo.ALGOS)
    tuning = ModuleType("rl_zoo3.hyperparams_opt")
    tuning.HYPERPARAMS_SAMPLER, tuning.HYPERPARAMS_CONVERTER = {}, {}
    for module in (ModuleType("rl_zoo3"), zoo, tuning):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.syspath_prepend(EXAMPLES)
    runpy.run_path(str(SCRIPT), run_name="__main__")
    exported = {name: getattr(curiosity_algos, name) for name in curiosity_algos.__all__}
    classes = {name: each for name, each in exported.items() if isinstance(each, type)}
    assert seen == {name: each for name, each in classes.items() if issubclass(each, BaseAlgorithm)}
    assert {"AURORA", "CMAME", "CuriosityES", "NSLC"} < set(seen)
    assert set(tuning.HYPERPARAMS_SAMPLER) == set(tuning.HYPERPARAMS_CONVERTER) == set(seen)


def test_the_example_tunes(tmp_path):
    options = {
        "algo": "CuriosityES",
        "env": ENV,
        "env-kwargs": "horizon:50",
        "n-timesteps": 5000,
        "n-evaluations": 5000,
        "n-eval-envs": 1,
        "eval-episodes": 1,
        "n-trials": 3,
        "pruner": "none",
        "sampler": "random",
        "seed": 0,
        "device": "cpu",
        "log-folder": tmp_path,
        "storage": "sqlite:///trials.db",
        "study-name": "tuning",
    }
    flags = ["--optimize-hyperparameters", "--no-optim-plots"]
    run_script(SCRIPT, tmp_path, [*CONF_FILE, *flags, *words(options)])
    (report,) = (tmp_path / "CuriosityES").glob("report_*.csv")
    trials = pd.read_csv(report)
    assert (trials["state"] == "COMPLETE").all()
    assert np.isfinite(trials["value"]).all()
    sampled = {f"params_{name}" for name in SPACES["CuriosityES"]}
    assert len(trials) == 3
    assert sampled <= set(trials)

    # What was tuned is trained.
    trial = {"trial-id": 1, "study-name": "tuning", "storage": f"sqlite:///{tmp_path}/trials.db"}
    model = CuriosityES.load(train(tmp_path, *words(trial)))
    assert model.learning_rate == pytest.approx(trials["params_learning_rate"][1])
    assert model.sigma == pytest.approx(trials["params_sigma"][1])


def test_algorithms_take_what_is_sampled():
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    for algorithm in ALGORITHMS:
        study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
        made, tried = find_algorithm(algorithm), []
        for _ in range(12):
            trial = study.ask()
            keywords = sampler(algorithm)(trial, 2, 1, {})
            assert set(trial.params) == set(SPACES[algorithm])
            assert convert(trial.params) == keywords
            tried.append(trial.params)
        assert set(keywords) <= set(inspect.signature(made).parameters)
        model = made(gym.make(ENV), seed=0, device="cpu", **keywords)
        of_buffer = getattr(model, "replay_buffer_kwargs", {})  # of TD3ICM
        kept = {n: getattr(model, n) if hasattr(model, n) else of_buffer[n] for n in keywords}
        kept.get("policy_kwargs", {}).pop("optimizer_kwargs", None)  # of TD3ICM's own
        assert kept == keywords, algorithm
        assert all(len({params[name] for params in tried}) > 1 for name in SPACES[algorithm])
