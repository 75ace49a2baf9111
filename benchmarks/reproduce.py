"""`python -m benchmarks.reproduce N` trains the runs of figure N of the paper, and draws it.

Finished runs are not trained again: interrupted, it goes on when it is called again.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from typer import Argument, BadParameter, Option, Typer, echo

from benchmarks import paper_figures
from benchmarks.paper_figures import MEASURES, Counts, count_final_states
from benchmarks.plan import BUDGETS, Plan, Series
from benchmarks.projection import Projection, project_rewarding, replay_rewarding
from curiosity_algos.cli import main
from curiosity_algos.cli.options import check_all, numbers
from curiosity_algos.common.presets import PRESETS
from curiosity_algos.experiments.canvas import add_note, check_out, save_figure
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.measures import Points
from curiosity_algos.experiments.sweep import sweep
from curiosity_gym.validation import check_choice

app = Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)


class TrainedRuns:
    """The data of figures, from the folders of a plan's runs.

    Every method raises FileNotFoundError if a run that it needs is missing, or not finished.

    Args:
        plan: Plan of the trained runs.

    Attributes:
        about: What their settings are.
    """

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.about = f"preset {plan.preset}"

    def curves(self, series: Series, env: str, measure: str) -> list[Points]:
        """The curves of all runs, of one of `MEASURES`; empty if none was trained."""
        return [MEASURES[measure](run) for run in self._runs(series, env)]

    def final_states(self, series: Series, env: str) -> Counts:
        """Numbers of episodes of all runs that ended in the squares of a maze, by y and x."""
        counts = [count_final_states(run, env) for run in self._runs(series, env)]
        return np.asarray(np.sum(counts, axis=0))

    def projection(self, panel: Sequence[Series], env: str) -> Projection:
        """Rewarding policies of all runs."""
        return project_rewarding(
            {
                series.algorithm: list(map(replay_rewarding, self._runs(series, env)))
                for series in panel
            }
        )

    def n_rewarding(self, series: Series, env: str) -> int:
        """How many rewarding policies all runs have found."""
        return sum(run.result["n_rewarding"] for run in self._runs(series, env))

    def _runs(self, series: Series, env: str) -> list[Run]:
        specs = [self.plan.run(series, env, seed) for seed in self.plan.seeds]
        runs = [Run(spec.folder(self.plan.folder)) for spec in specs]
        for spec, run in zip(specs, runs, strict=True):
            if run.result.get("timesteps", 0) < spec.timesteps:
                raise FileNotFoundError(
                    f"`log_folder` must hold the runs of the figure, {run} is not finished."
                )
        return runs


@app.command()
def reproduce(
    figures: Annotated[list[int], Argument(help="Figures of the paper, 1 to 8.", min=1, max=8)],
    budget: Annotated[
        str, Option(help="Length of the runs: smoke (seconds), short, tenth (of paper), or paper.")
    ] = "smoke",
    preset: Annotated[str, Option(help="Settings of the algorithms, paper or tuned.")] = "paper",
    seeds: Annotated[
        str | None, Option(help="Seeds, such as 0,1,2 or 0-4. Without it, those of the budget.")
    ] = None,
    log_folder: Annotated[
        Path | None,
        Option("--log-folder", "-f", help="Folder for the runs. Without it, runs/PRESET-BUDGET."),
    ] = None,
    out: Annotated[
        Path | None,
        Option(help="PNG, PDF or SVG to write. Without it, figure_N.png in the log folder."),
    ] = None,
    jobs: Annotated[
        int | None,
        Option(help="Runs at a time. Without it, one for each processor; with smoke, one."),
    ] = None,
) -> None:
    """Train the runs of the paper's figures, and draw them.

    Finished runs are not trained again, and figures share their runs.

    Example: python -m benchmarks.reproduce 2 --budget short --out reward.pdf
    """
    check_choice(tuple(BUDGETS), budget=budget)
    check_choice(PRESETS, preset=preset)
    folder = Path("runs", f"{preset}-{budget}") if log_folder is None else log_folder
    if out is not None and len(figures) > 1:
        raise BadParameter("`out` must be left out where several figures are drawn.")
    paths = {figure: out or folder / f"figure_{figure}.png" for figure in figures}
    for path in paths.values():
        check_out(path)
    chosen = BUDGETS[budget].seeds if seeds is None else numbers("seeds", seeds)
    plan = Plan(folder, BUDGETS[budget], preset, chosen)
    jobs = plan.budget.jobs if jobs is None else jobs
    needed = {run.folder(folder): run for figure in figures for run in plan.runs(figure)}
    runs = list(needed.values())
    check_all(runs)
    sweep(runs, folder, jobs=jobs)
    for figure, path in paths.items():
        drawing = paper_figures.draw(figure, TrainedRuns(plan))
        if note := plan.note(figure):
            add_note(drawing, note)
        save_figure(drawing, path)
        echo(f"{path}")


if __name__ == "__main__":
    main(app)
