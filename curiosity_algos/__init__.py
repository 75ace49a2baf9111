"""Curiosity-driven policy search behind Stable-Baselines3's API."""

from curiosity_algos.algorithms.canonical_es import CanonicalES
from curiosity_algos.algorithms.curiosity_es import CuriosityES
from curiosity_algos.common.presets import load_preset
from curiosity_algos.curiosity.icm import ICM
from curiosity_algos.evaluation.evaluator import make_evaluator
from curiosity_algos.evaluation.rollouts import Rollouts

__all__ = ["ICM", "CanonicalES", "CuriosityES", "Rollouts", "load_preset", "make_evaluator"]
