"""Runs in Weights & Biases (extra `track`)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import KVWriter

from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_gym.extras import import_extra


@dataclass(frozen=True)
class Project:
    """A project of Weights & Biases.

    Args:
        name: Name of the project.
        entity: Team or user; None: the user's default.
    """

    name: str
    entity: str | None = None

    def check(self) -> None:
        """Raise an error unless wandb is installed, and knows the user where it is online.

        Raises:
            gymnasium.error.DependencyNotInstalled: If wandb is not installed.
            ValueError: If nobody has logged in.
        """
        (wandb,) = import_extra("track", "wandb")
        try:
            wandb.login()
        except wandb.Error as error:
            raise ValueError(f"`track` needs a login at Weights & Biases: {error}") from error


class TrackRun(BaseCallback, KVWriter):
    """Sends what is logged, and the configuration in a run's folder, to Weights & Biases.

    A context manager, so that a run that fails is marked as failed. A run that goes on in its
    folder goes on there too: its id is kept in the file `wandb_id`.

    Args:
        project: Project that keeps the run.
        folder: Folder of the run; a `SaveRun` that is called first has begun it.
    """

    def __init__(self, project: Project, folder: Path) -> None:
        super().__init__()
        self._project = project
        self._folder = folder
        self._run: Any = None

    def __enter__(self) -> Self:
        """Send nothing before training begins."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Finish the run, as failed if there is an error."""
        if self._run is not None:
            self._run.finish(exit_code=int(kind is not None))

    def _on_training_start(self) -> None:
        (wandb,) = import_extra("track", "wandb")
        described, known = RunFolder(self._folder).describe(), self._folder / "wandb_id"
        self._run = wandb.init(
            project=self._project.name,
            entity=self._project.entity,
            name=f"{described['algorithm']} {described['env']} {described['seed']}",
            config=described,
            dir=str(self._folder),
            id=known.read_text() if known.exists() else None,
            resume="allow",
        )
        known.write_text(self._run.id)
        self.logger.output_formats.append(self)

    def _on_step(self) -> bool:
        return True

    def _on_training_end(self) -> None:
        self.logger.output_formats.remove(self)

    def write(
        self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0
    ) -> None:
        """Send the numbers of a log."""
        numbers = int | float | np.number
        row = {name: value for name, value in key_values.items() if isinstance(value, numbers)}
        self._run.log(row, step=step)

    def close(self) -> None:
        """Leave the run open: whoever began it finishes it."""
