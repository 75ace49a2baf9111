"""`curiosity export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option, echo

from curiosity_algos.cli.options import Trust, find_own_modules
from curiosity_gym.validation import check_choice


def export(
    run: Annotated[Path, Argument(help="The folder of a run.")],
    to: Annotated[str, Option(help="Format: minari for episodes, onnx for the best policy.")],
    out: Annotated[
        str, Option(help="Id of the dataset, such as curiosity/us-v0, or the .onnx file.")
    ],
    policies: Annotated[
        str, Option(help="Policies that play: elites, rewarding, or a sample of all.")
    ] = "rewarding",
    n_policies: Annotated[
        int, Option(help="Most policies that play. If there are more, a sample is drawn.")
    ] = 1000,
    trust: Trust = False,
) -> None:
    """Write episodes of a run for Minari, or its policy as ONNX.

    The dataset needs the extra `minari`, the graph of the best policy the extra `onnx`.

    Example: curiosity export runs/NSES/CuriosityMaze-US-v0/0 --to minari --out curiosity/us-v0

    Example: curiosity export runs/NSES/CuriosityMaze-US-v0/0 --to onnx --out policy.onnx
    """
    from curiosity_algos.experiments.export import export_minari, export_onnx

    check_choice(("minari", "onnx"), to=to)
    if trust:
        find_own_modules()
    options: dict[str, Any] = {"policies": policies, "n_policies": n_policies}
    if to == "onnx":
        if options != {"policies": "rewarding", "n_policies": 1000}:
            raise ValueError("`policies` and `n_policies` must be left out with --to onnx.")
        export_onnx(run, out)
        echo(out)
        return
    dataset = export_minari(run, out, **options, trust=trust)
    echo(f"{dataset.total_episodes:,} episodes, {dataset.total_steps:,} steps: {out}")
