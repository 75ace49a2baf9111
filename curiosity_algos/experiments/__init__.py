"""Experiments: runs that leave a record, and what is made of them."""

from curiosity_algos.experiments.loading import Run, load_final_states, load_progress, load_runs
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_algos.experiments.save_run import SaveRun

__all__ = ["Run", "RunFolder", "SaveRun", "load_final_states", "load_progress", "load_runs"]
