"""`python -m benchmarks.pretrained` trains the best runs of the results again, for their policies.

Of each algorithm, with its defaults, and environment that was rewarded, the seed with the highest
return. Another processor may round sums otherwise, and come to another run: where that finds
nothing, the next best seed follows. The best policy of those in the folder is written into the
package, and its return printed beside that of the results. Half an hour, and an hour or two for
each robot; may be interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer

from benchmarks.learning import SWEEPS
from benchmarks.results import read_runs
from curiosity_algos.cli.sweep import sweep
from curiosity_algos.experiments import RunFolder
from curiosity_algos.experiments.run_folder import write_arrays

FOLDER = Path(__file__).parents[1] / "curiosity_algos" / "pretrained"
TABLES = ("mazes", "labyrinth", "control", "locomotion_long")
FIELDS = ("parameters", "net_arch", "return", "episode_seed")


def rewarded_pairs(runs: pd.DataFrame) -> Iterator[pd.DataFrame]:
    """All rows of each algorithm and environment that was rewarded, the highest return first."""
    for _, rows in runs.groupby(["algorithm", "env"]):
        if rows["best_return"].max() > 0.0:
            yield rows.sort_values("best_return", ascending=False, kind="stable")


def keep_policy(runs: Path, path: Path) -> float:
    """Write what acts in the best policy of runs to a file, if it was rewarded; its return."""
    folders = [RunFolder(each.parent) for each in runs.glob("*/run.json")]
    best = max(folders, key=lambda folder: folder.result()["best_return"] or 0.0)
    assert best.checkpoint is not None
    with np.load(best.checkpoint / "best_policy.npz") as policy:
        if policy["return"] > 0.0:
            write_arrays(path, {name: policy[name] for name in FIELDS})
        return float(policy["return"])


def main(
    runs: Path = Path("runs/pretrained"),
    jobs: Annotated[int, typer.Option(help="Runs at a time.")] = 2,
    tables: Annotated[str, typer.Option(help="Of which results.")] = ",".join(TABLES),
    out: Path = FOLDER,
) -> None:
    """Train the best runs, and write a file for each."""
    for name in tables.split(","):
        settings = {**SWEEPS[name], "log_folder": runs / name, "jobs": jobs}
        found = read_runs(name)
        for rows in rewarded_pairs(found[found["algorithm"].isin(settings["algos"])]):
            for run in rows.itertuples():
                pair = {"algos": run.algorithm, "envs": run.env}
                sweep(**{**settings, **pair}, seeds=str(run.seed))
                folder = runs / name / run.algorithm / run.env
                total = keep_policy(folder, out / f"{run.algorithm}_{run.env}.npz")
                returns = f"{total:.4f}, {run.best_return:.4f} in the results"
                print(f"{run.algorithm} {run.env} {run.seed}: {returns}")
                if total > 0.0:
                    break


if __name__ == "__main__":
    typer.run(main)
