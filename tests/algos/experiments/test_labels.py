"""Names and colors of runs that are shown together."""

import pandas as pd

from curiosity_algos.common.names import ALGORITHMS
from curiosity_algos.experiments.labels import COLORS, FURTHER, color_labels, label_runs


def test_a_label_names_the_settings_that_tell_runs_of_one_environment_apart():
    runs = pd.DataFrame(
        {
            "algorithm": ["NSES", "NSES", "NSES", "NSLC", "NSLC"],
            "env": ["US", "US", "Hard", "US", "Hard"],
            "settings.behavior": ["final", "state", "final", "final", "final"],
            "settings.learning_rate": [0.5, 0.5, 1.0, 0.5, 1.0],
            "settings.device": ["cpu", "cuda", "cpu", "cpu", "cpu"],
            "settings.k": [10, 10, 10, [1], float("nan")],
        },
        index=[4, 3, 2, 1, 0],
    )
    labels = label_runs(runs)
    assert list(labels.index) == [4, 3, 2, 1, 0]
    assert list(labels) == [
        "NSES, behavior final",
        "NSES, behavior state",
        "NSES, behavior final",
        "NSLC",
        "NSLC",
    ]


def test_a_label_names_as_few_settings_as_it_takes_the_preset_first():
    runs = pd.DataFrame(
        {
            "algorithm": ["NSES"] * 4,
            "env": ["US"] * 4,
            "settings.k": [10, 10, 20, 20],
            "settings.preset": [None, None, "paper", "paper"],
            "settings.sigma": [0.1, 0.1, 0.2, 0.2],
            "settings.behavior": ["final", "state", "final", "state"],
        }
    )
    assert list(label_runs(runs)) == [
        "NSES, preset none, behavior final",
        "NSES, preset none, behavior state",
        "NSES, preset paper, behavior final",
        "NSES, preset paper, behavior state",
    ]


def test_wrappers_of_a_vec_env_are_settings():
    bonus = "vec_env.wrappers.BonusVecEnvWrapper"
    runs = pd.DataFrame(
        {
            "algorithm": ["PPO + APT"] * 2,
            "env": ["US"] * 2,
            f"{bonus}.device": ["cpu", "cuda"],
            f"{bonus}.weight": [1.0, 0.5],
            "vec_env.n_envs": [16, 16],
        }
    )
    names = [f"PPO + APT, BonusVecEnvWrapper.weight {weight}" for weight in (1, 0.5)]
    assert list(label_runs(runs)) == names


def test_every_algorithm_has_a_color_of_its_own():
    assert set(COLORS) == set(ALGORITHMS)
    assert len({*COLORS.values(), *FURTHER}) == len(COLORS) + len(FURTHER)


def test_as_many_labels_as_colors_are_told_apart():
    colors = color_labels(["PPO", "NSES", "PPO", "NSES, k 10"])
    assert colors == {"PPO": FURTHER[0], "NSES": COLORS["NSES"], "NSES, k 10": FURTHER[1]}
    labels = ["NSES", *(f"PPO, n_steps {n}" for n in range(len(COLORS) + len(FURTHER) - 1))]
    assert len({*color_labels(labels).values()}) == len(labels)
    assert len(color_labels([*labels, "SAC"])) == len(labels) + 1
