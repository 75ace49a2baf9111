"""A behavior space that is learned: the latent space of an autoencoder of trajectories.

Cully 2019, "Autonomous skill discovery with quality-diversity and unsupervised descriptors"
(https://arxiv.org/abs/1905.11874).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch as th

from curiosity_algos.common.arrays import Float32Array, Float64Array
from curiosity_algos.common.networks import (
    RunningNormalizer,
    check_gradients,
    mlp,
    single_torch_thread,
)
from curiosity_algos.common.randomness import integer_seed
from curiosity_algos.evaluation.rollouts import Rollouts, Summarizer, Summary, check_observations

STATES = "states"
"""Name of what is read of trajectories."""
HIDDEN = (32, 16)
"""Widths of the encoder's hidden layers; the decoder's are the same in reverse."""


@dataclass(frozen=True)
class EvenStates:
    """N states of each trajectory, evenly spaced from first to last; a `Summarizer`."""

    n: int

    def __call__(self, rollouts: Rollouts, individuals: slice) -> Summary:
        """One array, (P, n, O)."""
        observations, _ = rollouts.trajectories
        times = np.round(np.linspace(0.0, rollouts.lengths, self.n)).astype(np.int64).T
        states = observations[np.arange(len(rollouts))[:, None], times]
        check_observations(states)
        return (states,)


def _parts(states: Float32Array, size: int = 64) -> list[Float32Array]:
    """Batches of few trajectories: standardized copies of all would take an archive's memory."""
    return [states[begin : begin + size] for begin in range(0, len(states), size)]


class TrajectoryEncoder:
    """AURORA's behaviors: the code that an autoencoder reconstructs a trajectory from.

    Its arguments are those of `AURORA`.

    Attributes:
        shape: (n_states, O) of what it sees of a trajectory; None before `begin`.
        loss: Mean squared error in the last epoch of the last training; NaN before the first.
    """

    def __init__(
        self,
        n_dimensions: int,
        *,
        share: float,
        learning_rate: float,
        n_epochs: int,
        batch_size: int,
        seed: np.random.SeedSequence,
        device: th.device,
    ) -> None:
        self.n_dimensions = n_dimensions
        self.share = share
        self.learning_rate = learning_rate
        self.n_epochs = n_epochs
        self.batch_size = batch_size
        self.device = device
        self._generator = th.Generator().manual_seed(integer_seed(seed))
        self.shape: tuple[int, int] | None = None
        self.loss = math.nan

    def begin(self, rollouts: Rollouts) -> tuple[int, int]:
        """Make the networks for trajectories as long as the longest of these; `shape`."""
        # At least two: a single one would be the start, which is the same for all.
        n_states = max(2, math.ceil(self.share * int(rollouts.lengths.max())))
        return self._build(n_states, rollouts.final_observations.shape[1])

    def _build(self, n_states: int, n_observations: int) -> tuple[int, int]:
        widths = (n_states * n_observations, *HIDDEN, self.n_dimensions)
        self._normalizer = RunningNormalizer(n_observations)
        self._encoder = mlp(*widths, generator=self._generator)
        self._decoder = mlp(*widths[::-1], generator=self._generator)
        self._modules = th.nn.ModuleList([self._normalizer, self._encoder, self._decoder])
        self._modules.to(self.device)
        self._optimizer = th.optim.Adam(self._modules.parameters(), fused=True)
        self.shape = n_states, n_observations
        return self.shape

    def states(self, rollouts: Rollouts) -> Float32Array:
        """The states that the encoder sees of each trajectory, (P, n_states, O)."""
        assert self.shape is not None
        return rollouts.summary(STATES, self.summarizers)[0]

    def summarizers(self, n_individuals: int) -> dict[str, Summarizer]:
        """A summarizer for `states`."""
        assert self.shape is not None
        return {STATES: EvenStates(self.shape[0])}

    def train(self, states: Float32Array) -> None:
        """Learn to reconstruct trajectories (n, n_states, O)."""
        assert self.shape is not None
        check_gradients()
        self._optimizer.param_groups[0]["lr"] = self.learning_rate
        with single_torch_thread():
            # The scale of the states is taken anew: it grows with what is explored.
            fresh = RunningNormalizer(self.shape[1]).to(self.device)
            for part in _parts(states):
                fresh.observe(th.from_numpy(part).flatten(0, 1).to(self.device))
            self._normalizer.load_state_dict(fresh.state_dict())
            for _ in range(self.n_epochs):
                self.loss = self._epoch(states)

    def _epoch(self, states: Float32Array) -> float:
        order = th.randperm(len(states), generator=self._generator)
        losses = []
        for rows in th.split(order, self.batch_size):
            batch = self._inputs(states[rows.numpy()])
            loss = th.nn.functional.mse_loss(self._decoder(self._encoder(batch)), batch)
            self._optimizer.zero_grad(set_to_none=True)
            loss.backward()
            self._optimizer.step()
            losses.append(loss.item())
        return float(np.mean(losses))

    @th.no_grad()
    def encode(self, states: Float32Array) -> Float64Array:
        """Latent behaviors (n, n_dimensions) of trajectories (n, n_states, O)."""
        with single_torch_thread():
            chunks = [self._encoder(self._inputs(part)) for part in _parts(states)]
        return th.cat(chunks).cpu().numpy().astype(np.float64)

    def _inputs(self, states: Float32Array) -> th.Tensor:
        inputs: th.Tensor = self._normalizer(th.from_numpy(states).to(self.device)).flatten(1)
        return inputs

    def state_dict(self) -> dict[str, Any]:
        """Weights, scales, the optimizer's state and that of the draws."""
        generator = self._generator.get_state()
        if self.shape is None:
            return {"generator": generator}
        modules, optimizer = self._modules.state_dict(), self._optimizer.state_dict()
        state = {"modules": modules, "optimizer": optimizer, "generator": generator}
        return {**copy.deepcopy(state), "shape": list(self.shape), "loss": self.loss}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave."""
        self.shape, self.loss = None, math.nan
        if "shape" in state:
            self._build(*state["shape"])
            self._modules.load_state_dict(state["modules"])
            # Torch would keep the given tensors as the optimizer's own, and train on in them.
            self._optimizer.load_state_dict(copy.deepcopy(state["optimizer"]))
            self.loss = state["loss"]
        self._generator.set_state(state["generator"].cpu())
