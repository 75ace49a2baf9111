"""Which runs the paper's figures need."""

from pathlib import Path

from curiosity_algos.experiments.figures.plan import (
    BUDGETS,
    COMPARED,
    CONTROL,
    MAZES,
    SMOKE_GOALS,
    Plan,
    Series,
    series_of,
)

FIGURES = range(1, 9)


def make_plan(budget="paper"):
    return Plan(Path("runs"), BUDGETS[budget], "paper", (3, 4))


def folders(figure):
    return [str(run.folder("runs")) for run in make_plan().runs(figure)]


def test_figures_share_runs():
    assert not folders(1)
    assert set(folders(2)) == set(folders(3))
    assert len(folders(2)) == len(COMPARED) * len(MAZES) * 2
    assert set(folders(4)) | set(folders(8)) < set(folders(2))
    assert {folder.split("/")[1] for folder in folders(8)} == {"CuriosityES", "CMAME", "MAPElites"}
    assert len(folders(4)) == 9 * 2
    assert set(folders(5)) & set(folders(6))  # those that have nothing to switch off


def test_no_two_runs_share_a_folder():
    runs = {}
    for figure in FIGURES:
        for run in make_plan().runs(figure):
            assert runs.setdefault(run.folder("runs"), run) == run


def test_coverage_of_control_tasks_is_without_reward():
    settings = {run.algorithm: run.settings for run in make_plan().runs(6)}
    assert settings["CuriosityES"]["phi"] == settings["NSES"]["phi"] == 0.0
    assert settings["TD3ICM"]["extrinsic"] is False
    assert not {"phi", "extrinsic"} & (settings["MAPElites"].keys() | settings["CMAME"].keys())
    assert not any({"phi", "extrinsic"} & run.settings.keys() for run in make_plan().runs(5))
    assert "runs/phi=0.0/NSES/CuriosityControl-Finger-v0/3" in folders(6)


def test_the_bottleneck_compares_behaviors():
    panels = series_of(7)
    assert [env.split("-")[1] for env in panels] == ["Snake", "US", "Finger"]
    labels = ["CuriosityES", "NSES", "NSLC", "NSES (whole state)", "NSLC (whole state)"]
    for panel in panels.values():
        assert [series.label for series in panel] == [*labels, "AURORA", "MAPElites"]
    assert "runs/behavior=state,phi=0.0/NSES/CuriosityControl-Finger-v0/3" in folders(7)
    assert "runs/behavior=state/NSES/CuriosityMaze-US-v0/3" in folders(7)


def test_budgets():
    assert BUDGETS["paper"].seeds == (0, 1, 2, 3, 4)
    for env, horizon in [(MAZES[0], 2000), (CONTROL[0], 1000)]:
        run = make_plan().run(Series("NSES"), env, 0)
        assert run.timesteps == 2000 * 56 * horizon
        assert run.settings["preset"] == "paper"
        assert not run.env_kwargs
        assert make_plan().run(Series("TD3ICM"), env, 0).timesteps < run.timesteps / 100
    for name, budget in BUDGETS.items():
        plan = make_plan(name)
        assert all(run.timesteps > 0 for figure in FIGURES for run in plan.runs(figure))
        assert bool(budget.env_kwargs) == bool(plan.note(2))


def test_figures_of_easier_tasks_say_so():
    for env, radius in SMOKE_GOALS.items():
        assert BUDGETS["smoke"].env_kwargs[env]["goal_radius"] == radius
        assert f"{radius:g} ({env.split('-')[1]})" in make_plan("smoke").note(2)
    assert not make_plan("smoke").note(1)  # the mazes as they are
