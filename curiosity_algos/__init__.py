"""Curiosity-driven policy search behind Stable-Baselines3's API.

The algorithms with archives are imported when they are first asked for: pyribs, which they need,
takes longer to import than all else.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from curiosity_algos.algorithms.canonical_es import CanonicalES
from curiosity_algos.algorithms.curiosity_es import CuriosityES
from curiosity_algos.algorithms.nses import NSES
from curiosity_algos.algorithms.td3_icm import TD3ICM
from curiosity_algos.bonuses.apt import APT
from curiosity_algos.bonuses.disagreement import Disagreement
from curiosity_algos.bonuses.e3b import E3B
from curiosity_algos.bonuses.encoders import SmallCNN
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.bonuses.ngu import NGU
from curiosity_algos.bonuses.noveld import NovelD
from curiosity_algos.bonuses.ramp import RAMP
from curiosity_algos.bonuses.rnd import RND
from curiosity_algos.common.presets import load_preset
from curiosity_algos.evaluation.evaluator import make_evaluator
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper, ICMVecEnvWrapper
from curiosity_algos.sb3.callbacks import BonusCheckpointCallback, ExplorationCallback
from curiosity_algos.sb3.gymnasium_vec_env import GymnasiumVecEnv
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer

if TYPE_CHECKING:
    from curiosity_algos.algorithms.aurora import AURORA
    from curiosity_algos.algorithms.cma_me import CMAME
    from curiosity_algos.algorithms.curiosity_map_elites import CuriosityMAPElites
    from curiosity_algos.algorithms.map_elites import MAPElites
    from curiosity_algos.algorithms.nslc import NSLC

__all__ = [
    "APT",
    "AURORA",
    "CMAME",
    "E3B",
    "ICM",
    "NGU",
    "NSES",
    "NSLC",
    "RAMP",
    "RND",
    "TD3ICM",
    "BonusCheckpointCallback",
    "BonusReplayBuffer",
    "BonusVecEnvWrapper",
    "CanonicalES",
    "CuriosityES",
    "CuriosityMAPElites",
    "Disagreement",
    "ExplorationCallback",
    "GymnasiumVecEnv",
    "ICMVecEnvWrapper",
    "MAPElites",
    "NovelD",
    "Rollouts",
    "SmallCNN",
    "load_preset",
    "make_evaluator",
]

_WITH_ARCHIVES = {
    "AURORA": "aurora",
    "CMAME": "cma_me",
    "CuriosityMAPElites": "curiosity_map_elites",
    "MAPElites": "map_elites",
    "NSLC": "nslc",
}
"""Name: module of the algorithms that need pyribs."""


def __getattr__(name: str) -> object:
    """Import an algorithm with an archive (PEP 562)."""
    if name not in _WITH_ARCHIVES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.algorithms.{_WITH_ARCHIVES[name]}"), name)
    globals()[name] = value  # asked for once
    return value


def __dir__() -> list[str]:
    return sorted(globals().keys() | set(__all__))
