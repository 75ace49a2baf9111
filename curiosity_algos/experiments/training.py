"""One run, from its settings to its folder; one that was interrupted goes on."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecEnv

from curiosity_algos.common.interrupt import HeldInterrupt
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.experiments.baselines import is_baseline
from curiosity_algos.experiments.description import check_same, describe_run
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.save_run import SaveRun
from curiosity_algos.robust.measure import evaluate_starts, in_words, is_drawn
from curiosity_algos.robust.solve import Enough
from curiosity_algos.sb3.settle import SettleCallback


def is_finished(run: RunSpec, folder: Path) -> bool:
    """Whether the budget of the run in a folder is spent; False where there is none.

    Raises:
        ValueError: If the folder holds another run.
    """
    stored = RunFolder(folder)
    if stored.is_empty():
        return False
    with warnings.catch_warnings(action="ignore"):  # the run itself warns
        model = run.make()
    with _env_of(model):
        check_same(folder, stored.describe(), describe_run(model))
    result = stored.result()
    return bool(result) and result["timesteps"] >= run.timesteps and _is_measured(result)


def _is_measured(result: Mapping[str, Any]) -> bool:
    """Whether `learn` has ended, and its policy was tried from unseen starts if it is to be."""
    return bool(result.get("ended")) and ("starts" in result or not _has_found(result))


def train(
    run: RunSpec,
    folder: Path,
    *,
    interval: float = 60.0,
    progress_bar: bool = False,
    enough: Enough | None = None,
) -> bool:
    """Train until the budget is spent, from where the run in the folder stands.

    After Ctrl-C a checkpoint is taken when a generation has ended; Stable-Baselines3's algorithms
    continue from the last one, and train on one of torch's threads. The traceback of an error stays
    in the folder's `error.txt` until the run continues.

    Args:
        run: Run to train.
        folder: Folder of the run.
        interval: Seconds between two checkpoints.
        progress_bar: Show a bar of timesteps.
        enough: Ends a search before; None: nothing does.

    Returns:
        Whether there was anything to do.

    Raises:
        ValueError: If the folder holds another run.
    """
    save = SaveRun(folder, interval=interval, save_replay_buffer=True)
    if is_finished(run, folder):
        return False
    stored = RunFolder(folder)
    checkpoint, result = stored.checkpoint, stored.result()
    model = run.make() if checkpoint is None else run.load(checkpoint)
    with _env_of(model):
        is_over = enough is not None and enough.is_over(model)
        if is_over and _is_measured(result):
            return False
        stored.lock().release()  # raises where another process trains
        with _traceback_kept(folder), closing(save):
            rest = 0 if is_over else max(0, int(run.timesteps) - model.num_timesteps)
            # What a checkpoint is to hold is changed before it is saved.
            settles = [] if run.settle is None else [SettleCallback(run.settle)]
            callbacks: list[BaseCallback] = [*settles, save, *([] if enough is None else [enough])]
            if rest or not result.get("ended"):
                _learn(model, save, callbacks, rest, progress_bar=progress_bar)
            _measure_starts(model, run, stored)
    return True


@contextmanager
def _traceback_kept(folder: Path) -> Iterator[None]:
    """Write the traceback of an error into a run's folder, and say so in a note of the error."""
    path = RunFolder(folder).error
    path.unlink(missing_ok=True)
    try:
        yield
    except Exception as error:
        with suppress(OSError):  # as of a full disk
            path.write_text(traceback.format_exc(), encoding="utf-8")
            error.add_note(f"traceback in {path}")
        raise


def _learn(
    model: BaseAlgorithm,
    save: SaveRun,
    callbacks: list[BaseCallback],
    rest: int,
    *,
    progress_bar: bool,
) -> None:
    try:
        with single_torch_thread() if is_baseline(type(model)) else nullcontext():
            model.learn(rest, callbacks, reset_num_timesteps=False, progress_bar=progress_bar)
    except HeldInterrupt:  # after a second Ctrl-C a generation would be kept by half
        save.save()
        raise


def _measure_starts(model: BaseAlgorithm, run: RunSpec, folder: RunFolder) -> None:
    """Note from how many unseen starts the policy comes to what the run has; None: there is one."""
    if _has_found(folder.result()):
        with closing(run.make_single()) as env:
            folder.note(starts=evaluate_starts(model, env).counts if is_drawn(env) else None)


def _has_found(result: Mapping[str, Any]) -> bool:
    """Whether a run has had a success or a reward."""
    events = ("first_success_timesteps", "first_reward_timesteps")
    return any(result.get(event) is not None for event in events)


def _env_of(model: BaseAlgorithm) -> closing[VecEnv]:
    env = model.get_env()
    assert env is not None
    return closing(env)


def summary(folder: Path) -> str:
    """The result of a run with a checkpoint, in a line."""
    result = RunFolder(folder).result()
    best = result.get("best_return")
    words = [f"best return {'none' if best is None else f'{best:.3f}'}", _first(result)]
    shares = [f"{name} {share:.1%}" for name, share in result["coverage"].items()]
    if shares:
        words.append(f"coverage {', '.join(shares)}")
    if starts := result.get("starts"):
        found = in_words(starts["success"], starts["n"])
        words.append(f"succeeds by its best actions from {found}")
    return f"{folder}: {', '.join(words)}"


def _first(result: Mapping[str, Any]) -> str:
    """When a run first had a success, or else a reward, a return above 0."""
    for event in ("success", "reward"):
        timesteps = result.get(f"first_{event}_timesteps")
        if timesteps is not None:
            return f"first {event} after {timesteps:,} timesteps"
    return "no return above 0" if (result.get("best_return") or 0.0) < 0.0 else "no success"
