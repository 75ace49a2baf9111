"""A search on a Ray cluster that survives its end: start it again, and it goes on.

`python examples/ray_cluster.py` starts Ray on this machine; on a machine of a cluster, add
`--address auto`. Give `--out` a folder that outlives the machine.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import curiosity_gym  # noqa: F401  # registers the mazes
from curiosity_algos import CuriosityES
from curiosity_algos.evaluation.ray import RayEvaluator
from curiosity_algos.experiments import RunFolder, SaveRun


def main(
    env_id: Annotated[str, typer.Option("--env")] = "CuriosityMaze-US-v0",
    timesteps: float = 1e7,
    workers: Annotated[int | None, typer.Option(help="None: one a processor.")] = None,
    address: Annotated[str | None, typer.Option(help="Of a cluster; auto finds it.")] = None,
    out: Path = Path("runs/ray_cluster"),
    seed: int = 0,
) -> None:
    """Train until the budget is spent, with a checkpoint every minute."""
    evaluator = RayEvaluator(env_id, n_workers=workers, address=address)
    checkpoint = RunFolder(out).checkpoint
    if checkpoint is None:
        model = CuriosityES(env_id, evaluator=evaluator, seed=seed)
    else:
        model = CuriosityES.load(checkpoint / "model", env_id, evaluator=evaluator)
    rest = timesteps - model.num_timesteps
    if rest > 0:
        model.learn(rest, callback=SaveRun(out), reset_num_timesteps=False, progress_bar=True)
    print(f"{model.num_timesteps:,} timesteps, {model.n_workers} workers at the end.")
    print(f"Coverage {model.coverage:.1%}, best return {model.best_return:.3f}.")


if __name__ == "__main__":
    typer.run(main)
