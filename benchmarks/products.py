"""The matrix products that a run cannot do without, in billions of floating-point operations."""

from __future__ import annotations

from typing import Any

import torch as th

from curiosity_algos import CuriosityES
from curiosity_algos.bonuses.icm import ICM


def products(model: Any) -> float:
    """Of all that an evolutionary algorithm has computed so far: policies, scores, training."""
    sizes = model.policy.mlp.sizes.astype(float)
    done = 2e-9 * model.num_timesteps * float(sizes[:-1] @ sizes[1:])
    if isinstance(model, CuriosityES):
        done += products_of_scores(model) + products_of_updates(model)
    return done


def products_of_updates(model: CuriosityES) -> float:
    """Of all gradient steps so far."""
    motivation, bonus = model._motivation, model._motivation.bonus
    n = motivation.batch_size
    operations = 0.0
    for name, network in bonus.named_children():
        rows = 2 * n if name == "encoder" else n
        linear = [each for each in network.modules() if isinstance(each, th.nn.Linear)]
        # Forward, by the weights, and by the inputs, which those of the encoder need not.
        operations += sum(6.0 * rows * each.weight.numel() for each in linear)
        if linear and name == "encoder":
            operations -= 2.0 * rows * linear[0].weight.numel()
    if bonus.name == "apt":  # distances of all from all, and twice what they are pulled by
        operations += 3 * 2.0 * n * n * bonus.memory._features.shape[1]
    return 1e-9 * operations * motivation.n_updates * model.generation


def products_of_scores(model: CuriosityES) -> float:
    """Of the curiosity of all trajectories so far: each state is encoded once."""
    motivation, bonus = model._motivation, model._motivation.bonus
    n_scored = model.num_timesteps
    if motivation.n_states is not None:
        n_scored = model.generation * model.population_size * motivation.n_states
    operations = 2.0 * n_scored * _n_weights(bonus.encoder)
    if bonus.name == "icm":
        operations += 2.0 * n_scored * _n_weights(bonus.forward_model)
    if bonus.name == "apt":  # in each generation all that is remembered is encoded, and compared
        n_added = model.population_size * motivation.n_transitions
        size, n_features = bonus.memory._features.shape
        n_known = sum(min(size, generation * n_added) for generation in range(model.generation))
        operations += 2.0 * n_known * _n_weights(bonus.encoder)
        operations += 2.0 * n_known * n_features * n_scored / model.generation
    return 1e-9 * operations


def products_of_errors(bonus: ICM, n: int) -> float:
    """Of the curiosity of n transitions that share no state."""
    weights = 2 * _n_weights(bonus.encoder) + _n_weights(bonus.forward_model)
    return 2e-9 * n * weights


def _n_weights(network: th.nn.Module) -> int:
    linear = (each for each in network.modules() if isinstance(each, th.nn.Linear))
    return sum(each.weight.numel() for each in linear)
