"""A progress bar that counts timesteps: SB3's own adds the number of envs a call."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm


class ProgressBar(BaseCallback):
    """Shows timesteps done, coverage and the best return, and the workers of a cluster."""

    def _on_training_start(self) -> None:
        total = self.locals["total_timesteps"]
        self._bar = tqdm(
            total=total, initial=self.model.num_timesteps, unit="step", unit_scale=True
        )

    def _on_step(self) -> bool:
        # The last generation goes over the budget; the bar ends at the budget.
        assert self._bar.total is not None
        self._bar.update(min(self.model.num_timesteps, self._bar.total) - self._bar.n)
        model: Any = self.model  # SB3's hint is its base class, which has none of these
        coverage, best, n_workers = model.coverage, model.best_return, model.n_workers
        shown = {} if coverage is None else {"coverage": f"{coverage:.1%}"}
        shown |= {} if n_workers is None else {"workers": str(n_workers)}
        self._bar.set_postfix({**shown, "best return": f"{best:.3f}"})
        return True

    def _on_training_end(self) -> None:
        self._bar.close()
