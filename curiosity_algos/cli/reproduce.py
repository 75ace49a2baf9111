"""`curiosity reproduce`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option, echo

from curiosity_algos.cli import options


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

    Example: curiosity reproduce 2 --budget short --out reward.pdf
    """
    from curiosity_algos.common.presets import PRESETS
    from curiosity_algos.experiments.figures import canvas, paper
    from curiosity_algos.experiments.figures.plan import BUDGETS, Plan
    from curiosity_algos.experiments.sweep import sweep
    from curiosity_gym.validation import check_choice

    check_choice(tuple(BUDGETS), budget=budget)
    check_choice(PRESETS, preset=preset)
    folder = Path("runs", f"{preset}-{budget}") if log_folder is None else log_folder
    if out is not None and len(figures) > 1:
        raise ValueError("`out` must be left out where several figures are drawn.")
    paths = {figure: out or folder / f"figure_{figure}.png" for figure in figures}
    for path in paths.values():
        canvas.check_out(path)
    chosen = BUDGETS[budget].seeds if seeds is None else options.numbers("seeds", seeds)
    plan = Plan(folder, BUDGETS[budget], preset, chosen)
    jobs = plan.budget.jobs if jobs is None else jobs
    needed = {run.folder(folder): run for figure in figures for run in plan.runs(figure)}
    runs = list(needed.values())
    options.check_all(runs)
    sweep(runs, folder, jobs=jobs)
    for figure, path in paths.items():
        drawing = paper.draw(figure, paper.TrainedRuns(plan))
        if note := plan.note(figure):
            canvas.add_note(drawing, note)
        canvas.save_figure(drawing, path)
        echo(f"{path}")
