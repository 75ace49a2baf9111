"""Curiosity-driven policy search behind Stable-Baselines3's API."""

from curiosity_algos.algorithms.aurora import AURORA
from curiosity_algos.algorithms.canonical_es import CanonicalES
from curiosity_algos.algorithms.cma_me import CMAME
from curiosity_algos.algorithms.curiosity_es import CuriosityES
from curiosity_algos.algorithms.curiosity_map_elites import CuriosityMAPElites
from curiosity_algos.algorithms.map_elites import MAPElites
from curiosity_algos.algorithms.nses import NSES
from curiosity_algos.algorithms.nslc import NSLC
from curiosity_algos.algorithms.td3_icm import TD3ICM
from curiosity_algos.curiosity.callbacks import BonusCheckpointCallback, ExplorationCallback
from curiosity_algos.curiosity.icm import ICM
from curiosity_algos.curiosity.rnd import RND
from curiosity_algos.curiosity.vec_env import BonusVecEnvWrapper, ICMVecEnvWrapper
from curiosity_algos.evaluation.evaluator import make_evaluator, register_evaluator
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.loops.presets import load_preset

__all__ = [
    "AURORA",
    "CMAME",
    "ICM",
    "NSES",
    "NSLC",
    "RND",
    "TD3ICM",
    "BonusCheckpointCallback",
    "BonusVecEnvWrapper",
    "CanonicalES",
    "CuriosityES",
    "CuriosityMAPElites",
    "ExplorationCallback",
    "ICMVecEnvWrapper",
    "MAPElites",
    "Rollouts",
    "load_preset",
    "make_evaluator",
    "register_evaluator",
]
