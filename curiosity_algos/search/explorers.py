"""How to explore from a place: by actions that are held, or by linear policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd

from curiosity_algos.common.arrays import Array, Float32Array, Float64Array, Int64Array, Mask
from curiosity_algos.common.generators import generator_state, load_generator_state
from curiosity_algos.common.networks import RunningNormalizer
from curiosity_algos.evaluation.flat_spaces import ActionArray
from curiosity_algos.evaluation.open_loop import OpenLoopPolicy
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.state.check import check_like

HELD = "held"
EXPLORERS = (HELD, "linear")

CHANGE = 0.1
"""Probability that a held action changes in a step, at least."""
FRESH = 0.1
"""Share of policies that are drawn anew, not from the one that led to a place."""
FARTHEST = 5.0
"""Standard deviations from the mean that a policy sees at most."""
BIAS = 0.3
"""Weight of a policy's biases."""
FLOOR = 0.1
"""Share of explorations that each explorer has at least."""
POWER = 8
"""Of how far an explorer comes, by which it explores more often: of 8 dimensions as the volume."""
SHORTEST = 1e-12
"""Of the mean distances: shares are equal where nothing moves."""
MEMORY = 0.95
"""What remains of an explorer's record from generation to generation."""
SPACING = 10
"""Steps from one observation that is counted for standardization to the next."""

Rng = np.random.Generator


def held_outputs(
    rng: Rng, n: int, n_steps: int, n_outputs: int, *, is_discrete: bool
) -> Float32Array:
    """Outputs in [-1, 1], (n, n_steps, n_outputs), which change with a probability of a tenth.

    Discrete actions may be deeds, such as to open a door. There each of the n draws its own
    probability, from a tenth to 1.
    """
    drawn = rng.uniform(-1.0, 1.0, (n, n_steps, n_outputs)).astype(np.float32)
    change = CHANGE ** rng.random((n, 1)) if is_discrete else CHANGE
    steps = np.where(rng.random((n, n_steps)) < change, np.arange(n_steps), 0)
    return drawn[np.arange(n)[:, None], np.maximum.accumulate(steps, axis=1)]


class LinearPolicies:
    """Linear policies of standardized observations, as rows of parameters.

    Args:
        n_inputs: Length of an observation, O.
        n_outputs: Length of an output, M.

    Attributes:
        n_parameters: Length of a row, M (O + 1).
    """

    def __init__(self, n_inputs: int, n_outputs: int) -> None:
        self._shape = n_outputs, n_inputs + 1
        self.n_parameters = n_outputs * (n_inputs + 1)
        self._statistics = RunningMeanStd(shape=(n_inputs,))

    def draw(self, rng: Rng, n: int) -> Float32Array:
        """New policies, (n, n_parameters)."""
        return rng.standard_normal((n, self.n_parameters)).astype(np.float32)

    def vary(self, rng: Rng, parents: Float32Array, sigma: float) -> Float32Array:
        """A child of each of the parents (n, n_parameters); a tenth are drawn anew."""
        children = parents + sigma * self.draw(rng, len(parents))
        is_fresh = rng.random(len(parents)) < FRESH
        children[is_fresh] = self.draw(rng, int(is_fresh.sum()))
        return children.astype(np.float32)

    def act(self, policies: Float32Array, observations: Array) -> Float32Array:
        """Outputs in [-1, 1], (n, M), of policies (n, n_parameters) for observations (n, O)."""
        weights = policies.reshape(-1, *self._shape)
        seen = (observations - self._statistics.mean) / np.sqrt(self._statistics.var + 1e-8)
        seen = np.clip(seen, -FARTHEST, FARTHEST).astype(np.float32)
        sums = np.matmul(weights[:, :, :-1], seen[:, :, None])[:, :, 0]
        outputs: Float32Array = np.tanh(sums / np.sqrt(seen.shape[1]) + BIAS * weights[:, :, -1])
        return outputs.astype(np.float32)

    def observe(self, observations: Array) -> None:
        """Count observations (n, O) for standardization."""
        seen = self._statistics
        # As in RunningNormalizer: one observation like no other would hide all that come after it.
        largest = np.sqrt(seen.var * (RunningNormalizer.FARTHEST**2 + seen.count))
        if seen.count < RunningNormalizer.FARTHEST:  # too few to know a deviation by
            largest[:] = np.inf
        # A constant has no scale yet that this could destroy.
        largest[seen.var < RunningNormalizer.SMALLEST**2] = np.inf
        seen.update(np.clip(observations, seen.mean - largest, seen.mean + largest))

    def state_dict(self) -> dict[str, Any]:
        """The statistics."""
        seen = self._statistics
        return {"mean": seen.mean.copy(), "var": seen.var.copy(), "count": float(seen.count)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if it is of other observations."""
        check_like(state, self.state_dict(), "policies")
        seen = self._statistics
        seen.mean, seen.var, seen.count = state["mean"].copy(), state["var"].copy(), state["count"]


class Plan(NamedTuple):
    """How P explorations act.

    Attributes:
        explorers: (P,) the number of the explorer of each.
        policies: (P, n_parameters) the linear policy of each; of one that holds actions, that of
            the state where it begins, which it hands on.
        is_held: (P,) whether it holds actions.
        held: (P, n_steps, M) the outputs that it then has.
    """

    explorers: Int64Array
    policies: Float32Array
    is_held: Mask
    held: Float32Array


class Explorers:
    """The explorers, and which of them explores how often: by how far each has come.

    Args:
        names: Of the explorers, some of `EXPLORERS`.
        policy: Of the environment's spaces.
        seed: Of all draws.
    """

    def __init__(
        self, names: Sequence[str], policy: OpenLoopPolicy, *, seed: np.random.SeedSequence
    ) -> None:
        self._names, self._mlp, self._acted = list(names), policy.mlp, policy.acted
        self._linear = LinearPolicies(int(self._mlp.sizes[0]), len(self._mlp.center))
        self._played, self._come = np.ones(len(names)), np.ones(len(names))
        self._rng = np.random.default_rng(seed)

    @property
    def shares(self) -> dict[str, float]:
        """Of explorations, by explorer: more of one that comes further, a tenth at least."""
        means = np.maximum(self._come / self._played, SHORTEST)
        volumes = (means / means.max()) ** POWER
        shares = FLOOR + (1.0 - len(means) * FLOOR) * volumes / volumes.sum()
        return dict(zip(self._names, (shares / shares.sum()).tolist(), strict=True))

    def first(self) -> Float32Array:
        """A linear policy to begin with, (1, n_parameters)."""
        return self._linear.draw(self._rng, 1)

    def plan(self, parents: Float32Array, n_steps: int, sigma: float) -> Plan:
        """Plan explorations from states that policies (P, n_parameters) have led to."""
        n, rng = len(parents), self._rng
        explorers = rng.choice(len(self._names), n, p=list(self.shares.values()))
        is_held = np.array([name == HELD for name in self._names])[explorers]
        children = self._linear.vary(rng, parents, sigma)
        policies = np.where(is_held[:, None], parents, children)
        return Plan(explorers, policies, is_held, self._held(n, n_steps))

    def _held(self, n: int, n_steps: int) -> Float32Array:
        n_outputs, is_discrete = len(self._mlp.low), self._mlp.is_discrete
        return held_outputs(self._rng, n, n_steps, n_outputs, is_discrete=is_discrete)

    def act(self, plan: Plan, rows: Int64Array, t: int, observations: Array) -> ActionArray:
        """Actions for a bonus of explorations `rows` (k,) in their step t."""
        outputs = self._linear.act(plan.policies[rows], observations)
        return self._choose(np.where(plan.is_held[rows][:, None], plan.held[rows, t], outputs))

    def _choose(self, outputs: Float32Array) -> ActionArray:
        if not self._mlp.is_discrete:
            scaled = self._mlp.center + self._mlp.half_range * outputs
            outputs = np.clip(scaled, self._mlp.low, self._mlp.high)
        return self._acted.choose(outputs)

    def walk(self, n_steps: int) -> Array:
        """Random actions (n_steps, ...) of the environment."""
        return self._acted.taken(self._choose(self._held(1, n_steps)[0]))

    def learn(self, plan: Plan, distances: Float64Array, rollouts: Rollouts) -> None:
        """Record how far (P,) explorations came, and standardize by what they observed."""
        n = len(self._names)
        self._played = MEMORY * self._played + np.bincount(plan.explorers, minlength=n)
        self._come = MEMORY * self._come + np.bincount(plan.explorers, distances, minlength=n)
        observations, _ = rollouts.trajectories
        rows = zip(observations, rollouts.lengths, strict=True)
        self._linear.observe(np.concatenate([row[:n:SPACING] for row, n in rows]))

    def state_dict(self) -> dict[str, Any]:
        """The record, the statistics of observations, and the state of the draws."""
        record = {"played": self._played.copy(), "come": self._come.copy()}
        return {**record, "linear": self._linear.state_dict(), "rng": generator_state(self._rng)}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Take over what `state_dict` gave; ValueError if it is of others."""
        check_like(state, self.state_dict(), "explorers")
        self._played, self._come = state["played"].copy(), state["come"].copy()
        self._linear.load_state_dict(state["linear"])
        load_generator_state(self._rng, state["rng"])
