"""How runs are named and colored where several are shown together."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from curiosity_algos.experiments.description import MAY_DIFFER

COLORS = {
    "CuriosityES": "#CC3311",
    "NSES": "#0077BB",
    "MAPElites": "#009988",
    "CMAME": "#EE7733",
    "TD3ICM": "#AA3377",
    "NSLC": "#33BBEE",
    "AURORA": "#999933",
    "CuriosityMAPElites": "#882255",
    "CanonicalES": "#777777",
}
"""Of algorithms: told apart by the color-blind (Paul Tol's vibrant and muted schemes)."""
FURTHER = ("#332288", "#117733", "#DDCC77", "#CC6677", "#44AA99", "#BBBBBB")
"""Of what has no color of its own, in turn."""


def label_runs(runs: pd.DataFrame) -> pd.Series:
    """A name for each row of `load_runs`: its algorithm, and the settings that tell it from others.

    A setting counts where runs of one algorithm on one environment differ in it.
    """
    prefix = "settings."
    free = {prefix + name for name in MAY_DIFFER}
    settings = [name for name in runs if name.startswith(prefix) and name not in free]
    texts = runs[settings].map(str)
    n_values = texts.groupby([runs["algorithm"], runs["env"]]).nunique().groupby("algorithm").max()
    telling = {
        name: [each for each in settings if row[each] > 1] for name, row in n_values.iterrows()
    }
    return pd.Series(
        [
            ", ".join(
                [
                    name,
                    *(f"{each.removeprefix(prefix)} {texts.at[i, each]}" for each in telling[name]),
                ]
            )
            for i, name in runs["algorithm"].items()
        ],
        index=runs.index,
        dtype=object,
    )


def color_labels(labels: Iterable[str]) -> dict[str, str]:
    """A color for each label, the algorithm's own where the label is its name alone."""
    unique = list(dict.fromkeys(labels))
    others = [label for label in unique if label not in COLORS]
    further = {label: FURTHER[i % len(FURTHER)] for i, label in enumerate(others)}
    return {label: COLORS.get(label) or further[label] for label in unique}
