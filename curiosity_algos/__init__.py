"""Curiosity-driven policy search behind Stable-Baselines3's API.

What is in here is imported when it is first asked for: PyTorch and pyribs take seconds, which the
command needs neither to print its help nor to complete a word.
"""

from importlib import import_module
from typing import TYPE_CHECKING

import curiosity_gym  # noqa: F401  registers the ids

if TYPE_CHECKING:
    from curiosity_algos.algorithms.aurora import AURORA as AURORA
    from curiosity_algos.algorithms.canonical_es import CanonicalES as CanonicalES
    from curiosity_algos.algorithms.cma_me import CMAME as CMAME
    from curiosity_algos.algorithms.curiosity_es import CuriosityES as CuriosityES
    from curiosity_algos.algorithms.curiosity_map_elites import (
        CuriosityMAPElites as CuriosityMAPElites,
    )
    from curiosity_algos.algorithms.go_explore import GoExplore as GoExplore
    from curiosity_algos.algorithms.map_elites import MAPElites as MAPElites
    from curiosity_algos.algorithms.nses import NSES as NSES
    from curiosity_algos.algorithms.nslc import NSLC as NSLC
    from curiosity_algos.algorithms.td3_icm import TD3ICM as TD3ICM
    from curiosity_algos.bonuses.apt import APT as APT
    from curiosity_algos.bonuses.disagreement import Disagreement as Disagreement
    from curiosity_algos.bonuses.e3b import E3B as E3B
    from curiosity_algos.bonuses.encoders import SmallCNN as SmallCNN
    from curiosity_algos.bonuses.etd import ETD as ETD
    from curiosity_algos.bonuses.icm import ICM as ICM
    from curiosity_algos.bonuses.ngu import NGU as NGU
    from curiosity_algos.bonuses.noveld import NovelD as NovelD
    from curiosity_algos.bonuses.ramp import RAMP as RAMP
    from curiosity_algos.bonuses.rnd import RND as RND
    from curiosity_algos.common.presets import load_preset as load_preset
    from curiosity_algos.evaluation.evaluator import make_evaluator as make_evaluator
    from curiosity_algos.evaluation.rollouts import Rollouts as Rollouts
    from curiosity_algos.robust.demonstrations import Demonstration as Demonstration
    from curiosity_algos.robust.measure import Starts as Starts
    from curiosity_algos.robust.measure import evaluate_starts as evaluate_starts
    from curiosity_algos.robust.robustify import robustify as robustify
    from curiosity_algos.robust.solve import solve as solve
    from curiosity_algos.robust.starts import DemonstrationStarts as DemonstrationStarts
    from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper as BonusVecEnvWrapper
    from curiosity_algos.sb3.bonus_wrapper import ICMVecEnvWrapper as ICMVecEnvWrapper
    from curiosity_algos.sb3.callbacks import BonusCheckpointCallback as BonusCheckpointCallback
    from curiosity_algos.sb3.callbacks import ExplorationCallback as ExplorationCallback
    from curiosity_algos.sb3.callbacks import FinalBehaviors as FinalBehaviors
    from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv as GymnasiumVecEnv
    from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer as BonusReplayBuffer
    from curiosity_algos.sb3.settle import SettleCallback as SettleCallback

_MODULES = {
    "APT": "bonuses.apt",
    "AURORA": "algorithms.aurora",
    "CMAME": "algorithms.cma_me",
    "E3B": "bonuses.e3b",
    "ETD": "bonuses.etd",
    "ICM": "bonuses.icm",
    "NGU": "bonuses.ngu",
    "NSES": "algorithms.nses",
    "NSLC": "algorithms.nslc",
    "RAMP": "bonuses.ramp",
    "RND": "bonuses.rnd",
    "TD3ICM": "algorithms.td3_icm",
    "BonusCheckpointCallback": "sb3.callbacks",
    "BonusReplayBuffer": "sb3.replay_buffer",
    "BonusVecEnvWrapper": "sb3.bonus_wrapper",
    "CanonicalES": "algorithms.canonical_es",
    "CuriosityES": "algorithms.curiosity_es",
    "CuriosityMAPElites": "algorithms.curiosity_map_elites",
    "Demonstration": "robust.demonstrations",
    "DemonstrationStarts": "robust.starts",
    "Disagreement": "bonuses.disagreement",
    "ExplorationCallback": "sb3.callbacks",
    "FinalBehaviors": "sb3.callbacks",
    "GoExplore": "algorithms.go_explore",
    "GymnasiumVecEnv": "sb3.gymnasium_vec_env",
    "ICMVecEnvWrapper": "sb3.bonus_wrapper",
    "MAPElites": "algorithms.map_elites",
    "NovelD": "bonuses.noveld",
    "Rollouts": "evaluation.rollouts",
    "SettleCallback": "sb3.settle",
    "SmallCNN": "bonuses.encoders",
    "Starts": "robust.measure",
    "evaluate_starts": "robust.measure",
    "load_preset": "common.presets",
    "make_evaluator": "evaluation.evaluator",
    "robustify": "robust.robustify",
    "solve": "robust.solve",
}
"""Public name: module that defines it."""
__all__ = list(_MODULES)


def __getattr__(name: str) -> object:
    """Import a public name (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value  # asked for once
    return value


def __dir__() -> list[str]:
    return sorted(globals().keys() | set(__all__))
