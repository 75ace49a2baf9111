"""Which entries of an observation change as others and the action foretell."""

from __future__ import annotations

import torch as th

N_RANDOM = 64
"""Random features of entries and actions, with which least squares see products of them, too."""
LEAST = 0.3
"""Share of the largest explained share from which on an entry counts fully; from half of it on it
counts at all."""
SMALLEST = 0.01
"""Largest share below which nothing is foretold."""
RIDGE = 1e-3
"""Added to the second moments, of numbers whose deviation is 1."""


class ForetoldEntries(th.nn.Module):
    """How far each entry's change is foretold by the other entries and by the action.

    Least squares foretell the change over a transition, by all entries and the action and random
    features of them, and by the entry itself alone. An entry's share is how much less is left by
    the former than by the latter. What stays as it was at the beginning of an episode has none, and
    neither has noise that goes its own way, drawn anew or drifting; noise that several entries have
    in common may have one.

    Args:
        n_entries: O, of an observation.
        n_actions: A, numbers of an encoded action.
        generator: Draws the random features.

    Attributes:
        gate: (O,), from 0, an entry does not count, to 1.
    """

    gate: th.Tensor
    products: th.Tensor
    by_itself: th.Tensor
    count: th.Tensor
    weights: th.Tensor
    biases: th.Tensor

    def __init__(self, n_entries: int, n_actions: int, *, generator: th.Generator) -> None:
        super().__init__()
        n = n_entries + n_actions
        drawn = th.randn(n + 1, N_RANDOM, generator=generator, dtype=th.float64)
        n_known = n + N_RANDOM + 1
        self.register_buffer("weights", drawn[:n] * (2.0 / n**0.5))
        self.register_buffer("biases", drawn[n])
        self.register_buffer("gate", th.ones(n_entries))
        self.register_buffer("products", th.zeros(n_known, n_known + n_entries, dtype=th.float64))
        self.register_buffer("by_itself", th.zeros(5, n_entries, dtype=th.float64))
        self.register_buffer("count", th.zeros((), dtype=th.float64))

    @th.no_grad()
    def learn(self, before: th.Tensor, actions: th.Tensor, after: th.Tensor) -> None:
        """See transitions: standardized observations (n, O), encoded actions (n, A)."""
        x, change = before.double(), after.double() - before.double()
        known = th.cat([x, actions.double()], dim=1)
        random = th.tanh(known @ self.weights + self.biases)
        known = th.cat([known, random, th.ones_like(known[:, :1])], dim=1)
        self.products += known.T @ th.cat([known, change], dim=1)
        self.by_itself += th.stack([x, x * x, change, change * change, x * change]).sum(dim=1)
        self.count += len(x)

    @th.no_grad()
    def settle(self) -> None:
        """Set the gate by what was seen so far; where nothing is foretold all entries count."""
        if not self.count:
            return
        shares = self.shares()
        largest = shares.max()
        if largest < SMALLEST:
            self.gate.fill_(1.0)
        else:
            self.gate.copy_((2.0 * shares / (LEAST * largest) - 1.0).clamp(0.0, 1.0))

    def shares(self) -> th.Tensor:
        """Share (O,) of each entry's change that others foretell, in [0, 1]."""
        n = len(self.products)
        known, changes = (self.products / self.count).split([n, len(self.gate)], dim=1)
        ridge = RIDGE * th.eye(n, dtype=th.float64, device=known.device)
        slopes = th.linalg.solve(known + ridge, changes)
        x, squares, change, changed, together = self.by_itself / self.count
        left = changed - 2.0 * (slopes * changes).sum(0) + (slopes * (known @ slopes)).sum(0)
        variance = (squares - x * x).clamp_min(1e-9)
        alone = changed - change * change - (together - x * change).square() / variance
        shares = 1.0 - left / alone.clamp_min(1e-9)
        return th.where(alone > 1e-6, shares, 0.0).clamp(0.0, 1.0)
