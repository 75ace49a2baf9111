"""The archives of runs: which of them can be compared, and their curves."""

from __future__ import annotations

from functools import partial

import pandas as pd

from curiosity_algos.experiments.measures import logged, with_differences
from curiosity_algos.experiments.run import Run

QD_SCORE, SIZE = "archive/qd_score", "archive/size"
"""Columns of the log."""
qd_score = partial(logged, column=QD_SCORE)
"""Sum of the elites' returns, less the archive's `qd_score_offset` for each of them."""
n_elites = partial(logged, column=SIZE)
"""Number of elites."""
CELLS = {"dims", "centroids"}
"""Settings of archives that say which cells they have."""


def with_archives(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows of `load_compared` whose logs have a QD score, and a column `archive`.

    QD scores of one `archive` can be compared: they are of one environment, and of archives of one
    class with the same cells and `qd_score_offset`. Of archives without cells, such as
    `UnstructuredArchive`, each label has its own.
    """
    archives = [_archive_of(*row) for row in zip(runs["files"], runs["label"], strict=True)]
    texts = pd.DataFrame(archives, index=runs.index).dropna(how="all").astype(object)
    texts = texts.where(texts.notna(), "none").reindex(columns=["archive", *texts.columns[1:]])
    runs = runs.loc[texts.index]
    names = runs["env"] + ", " + texts.pop("archive")
    return runs.assign(archive=with_differences(names, texts))


def _archive_of(run: Run, label: str) -> dict[str, str]:
    """The class of a run's `archive` and its settings, in words; empty without a QD score."""
    archive = run.description.get("archive")
    if not archive or not {QD_SCORE, SIZE} <= {*run.progress}:
        return {}
    ((name, settings),) = archive.items()
    if settings.keys() & CELLS:
        return {"archive": name} | {key: str(value) for key, value in settings.items()}
    return {"archive": f"{name} of {label}"}
