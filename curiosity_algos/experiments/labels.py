"""Names and colors of runs where several are shown together."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import cycle
from typing import Any

import pandas as pd

from curiosity_algos.experiments.differences import MAY_DIFFER

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
"""Colors of algorithms, told apart by the color-blind (Paul Tol's vibrant and muted schemes)."""
FURTHER = ("#332288", "#117733", "#DDCC77", "#CC6677", "#44AA99", "#BBBBBB")
"""Colors, in turn, of what has none of its own, before those of algorithms that are not there."""

SETTINGS = r"^(settings|vec_env\.wrappers|vec_env)\."
"""Beginnings of the columns that hold settings."""


def label_runs(runs: pd.DataFrame) -> pd.Series:
    """A name for each row of `load_runs`: its algorithm, and the settings that tell it from others.

    A setting, of the algorithm or of a VecEnv and its wrappers, counts where runs of one algorithm
    on one environment differ in it, unless others tell the same runs apart; the preset comes first.
    """
    texts = runs.filter(regex=SETTINGS).map(setting_text)
    texts = texts.rename(columns=lambda name: re.sub(SETTINGS, "", name))
    # Results do not depend on these.
    texts = texts[[name for name in texts if name.rpartition(".")[2] not in MAY_DIFFER]]
    telling: dict[str, list[str]] = {name: [] for name in runs["algorithm"]}
    for (name, _), rows in texts.groupby([runs["algorithm"], runs["env"]], dropna=False):
        telling[name] += [each for each in _telling(rows) if each not in telling[name]]
    return pd.Series(
        [
            ", ".join([name, *(f"{each} {texts.at[i, each]}" for each in telling[name])])
            for i, name in runs["algorithm"].items()
        ],
        index=runs.index,
        dtype=object,
    )


def setting_text(value: Any) -> str:
    """The text of a setting: "none" of one that is not given, which is NaN where others have it."""
    if value is None or value != value:
        return "none"
    # Beside NaN, pandas has whole numbers as floats.
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _telling(texts: pd.DataFrame) -> list[str]:
    """Settings that tell apart all rows that differ at all."""
    kept: list[str] = []
    n_groups = 1
    for name in sorted(texts, key=lambda name: name != "preset"):
        n = len(texts[[*kept, name]].drop_duplicates())
        if n > n_groups:
            kept.append(name)
            n_groups = n
    return kept


def color_labels(labels: Iterable[str]) -> dict[str, str]:
    """A color for each label, the algorithm's own where the label is its name alone."""
    unique = list(dict.fromkeys(labels))
    others = [label for label in unique if label not in COLORS]
    unused = [color for name, color in COLORS.items() if name not in unique]
    further = dict(zip(others, cycle([*FURTHER, *unused]), strict=False))
    return {label: COLORS.get(label) or further[label] for label in unique}
