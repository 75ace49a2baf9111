"""Sparse-reward environments for Gymnasium; importing this package registers their ids."""

from curiosity_gym.drawn import random_layout
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.registration import register_envs
from curiosity_gym.wrappers.behavior import BehaviorAccumulator, BehaviorWrapper
from curiosity_gym.wrappers.record_episode import RecordEpisode
from curiosity_gym.wrappers.sparse import SparseRewardWrapper

__version__ = "1.0.0rc1"

__all__ = [
    "BehaviorAccumulator",
    "BehaviorWrapper",
    "MazeLayout",
    "RecordEpisode",
    "SparseRewardWrapper",
    "random_layout",
    "register_envs",
]

register_envs()
