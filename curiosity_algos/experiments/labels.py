"""Names and colors of runs that are compared."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import cycle
from typing import Any

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
    "GoExplore": "#000000",
}
"""Colors of algorithms for the color-blind, too (Paul Tol's vibrant and muted schemes)."""
FURTHER = ("#332288", "#117733", "#DDCC77", "#CC6677", "#44AA99", "#BBBBBB")
"""Colors of other labels, in turn; the colors of absent algorithms follow."""

SETTINGS = r"^(settings|vec_env\.wrappers|vec_env)\."
"""Beginnings of the columns that hold settings."""


def label_runs(runs: pd.DataFrame) -> pd.Series:
    """Names of the rows of `load_runs`: the algorithm, and the settings that distinguish it.

    A setting is named if runs of one algorithm on one environment differ in it, unless others
    distinguish the same runs. The preset comes first.
    """
    texts = runs.filter(regex=SETTINGS).map(setting_text)
    texts = texts.rename(columns=lambda name: re.sub(SETTINGS, "", name))
    # Results do not depend on these.
    texts = texts[[name for name in texts if name.rpartition(".")[2] not in MAY_DIFFER]]
    settings: dict[str, list[str]] = {algorithm: [] for algorithm in runs["algorithm"]}
    for (algorithm, _), rows in texts.groupby([runs["algorithm"], runs["env"]], dropna=False):
        known = settings[algorithm]
        known += [name for name in _distinguishing(rows) if name not in known]
    return pd.Series(
        [
            ", ".join([algorithm, *(f"{name} {texts.at[i, name]}" for name in settings[algorithm])])
            for i, algorithm in runs["algorithm"].items()
        ],
        index=runs.index,
        dtype=object,
    )


def setting_text(value: Any) -> str:
    """The text of a setting; "none" if it is None, or NaN as only other runs have it."""
    if value is None or value != value:
        return "none"
    # Beside NaN, pandas has whole numbers as floats.
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)


def _distinguishing(texts: pd.DataFrame) -> list[str]:
    """Settings that distinguish all rows that differ at all."""
    names: list[str] = []
    for name in sorted(texts, key=lambda name: name != "preset"):
        n_groups = len(texts[names].drop_duplicates()) if names else 1
        if len(texts[[*names, name]].drop_duplicates()) > n_groups:
            names.append(name)
    return names


def color_labels(labels: Iterable[str]) -> dict[str, str]:
    """A color for each label: the algorithm's own if the label is just its name."""
    unique = list(dict.fromkeys(labels))
    others = [label for label in unique if label not in COLORS]
    unused = [color for name, color in COLORS.items() if name not in unique]
    further = dict(zip(others, cycle([*FURTHER, *unused]), strict=False))
    return {label: COLORS.get(label) or further[label] for label in unique}
