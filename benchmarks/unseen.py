"""How finished policies do from starts that they have not seen: `python -m benchmarks.unseen NAME`.

The runs are those of `python -m benchmarks.learning NAME`, control_random or locomotion_long, whose
every generation plays one start: the return of a best policy is that of an easy start.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from benchmarks.results import FOLDER, KEYS, add_rows, label
from benchmarks.run_tables import by_environment
from curiosity_algos import make_evaluator
from curiosity_algos.common.names import find_algorithm
from curiosity_algos.experiments import load_runs
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.run_folder import RunFolder


def main(
    name: Annotated[str, typer.Argument(help="control_random or locomotion_long.")],
    runs: Annotated[Path, typer.Option(help="That holds the folder of the name.")] = Path("runs"),
    starts: Annotated[int, typer.Option(min=1, help="Episodes of each policy.")] = 100,
    out: Annotated[Path, typer.Option(help="Where the CSV file goes.")] = FOLDER,
) -> None:
    """Count the starts that the best policy of each run solves, and add them to a CSV file."""
    table = load_runs(runs / name)
    table["algorithm"] = label(table, runs / name)
    table["starts"] = starts
    table["solved"] = [count(Path(run), starts) for run in table["run"]]
    add_rows(table[[*KEYS, "starts", "solved"]], out / f"{name}_unseen.csv", KEYS)


def count(path: Path, n_starts: int) -> int:
    """Of one run: how many of the starts of seeds 0 to `n_starts - 1` its best policy solves."""
    run = RunFolder(path)
    described = run.describe()
    algorithm = find_algorithm(described["algorithm"])
    model = run.read(lambda checkpoint: algorithm.load(checkpoint / "model"))
    evaluator = make_evaluator(make_env(described, trust=True))
    policy = model.policy.vector[None]
    return sum(int(evaluator.evaluate(policy, seed).success[0]) for seed in range(n_starts))


def table(values: pd.DataFrame) -> str:
    """A row for each algorithm: of so many starts those that the policy of each seed solves."""
    (n_starts,) = values["starts"].unique()
    head = f"Of {n_starts} starts"
    return by_environment(values, lambda group: " / ".join(map(str, group["solved"])), head)


if __name__ == "__main__":
    typer.run(main)
