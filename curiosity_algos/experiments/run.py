"""What a run has left in its folder, for those who only read it."""

from __future__ import annotations

import os
from functools import cached_property
from typing import Any, TypeAlias

import pandas as pd

from curiosity_algos.common.arrays import Array
from curiosity_algos.experiments.reading import read_final_states, read_log
from curiosity_algos.experiments.run_folder import RunFolder

StrPath: TypeAlias = str | os.PathLike[str]


class Run:
    """A run that is read: each of its files once, when it is first asked for.

    Another `Run` of the folder reads what has been written since.

    Args:
        path: Folder of the run.

    Raises:
        FileNotFoundError: When an attribute is read, if there is no run.
        ValueError: Likewise, if the run is of another format, or a file is damaged.
    """

    def __init__(self, path: StrPath) -> None:
        self.folder = RunFolder(path)

    def __str__(self) -> str:
        return str(self.folder.path)

    @cached_property
    def description(self) -> dict[str, Any]:
        """The fields of `run.json`."""
        return self.folder.describe()

    @cached_property
    def result(self) -> dict[str, Any]:
        """The fields of `result.json` in the last checkpoint; empty before the first."""
        return self.folder.result()

    @cached_property
    def progress(self) -> pd.DataFrame:
        """The rows of `progress.csv`: columns of floats, or of texts."""
        return read_log(self.folder.progress).apply(_as_numbers)

    @cached_property
    def final_states(self) -> dict[str, Array]:
        """The columns of the final states, an entry for each episode; empty before the first."""
        _ = self.description  # raises where there is no run
        return read_final_states(self.folder.final_state_files())

    def forget_final_states(self) -> None:
        """Free the memory of the final states: they are read again when they are asked for."""
        vars(self).pop("final_states", None)


def _as_numbers(texts: pd.Series) -> pd.Series:
    texts = texts.where(texts != "")  # a row may lack an entry
    try:
        return texts.astype(float)
    except ValueError:
        return texts
