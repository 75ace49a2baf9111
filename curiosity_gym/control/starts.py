"""Random starts of a control task: dm_control's own."""

from __future__ import annotations

import copy
from types import SimpleNamespace

import numpy as np

from curiosity_gym.control.tasks import ControlTask
from curiosity_gym.core import Float64Array
from curiosity_gym.extras import import_extra


class RandomStarts:
    """Draws starts as dm_control does, and draws again where the task is already solved.

    Args:
        task: The task; its model stays as it is.
    """

    def __init__(self, task: ControlTask) -> None:
        # dm_control moves the target in the model itself.
        (wrapper,) = import_extra("control", "dm_control.mujoco.wrapper")
        model = wrapper.MjModel(copy.copy(task.model))
        self._task = task
        self._physics = task.suite.Physics.from_model(model)

    def draw(self, rng: np.random.Generator) -> Float64Array:
        """A start, (S,), as `ControlTask.state` gives it.

        Args:
            rng: Every draw is made from its bit generator.
        """
        episode = self._task.make_suite_task(np.random.RandomState(rng.bit_generator))
        while True:
            with self._physics.reset_context():
                episode.initialize_episode(self._physics)
            if not self._is_solved():
                return self._task.state(self._physics.model.ptr, self._physics.data.ptr)

    def _is_solved(self) -> bool:
        data = self._physics.data.ptr
        fields = {name: getattr(data, name)[None] for name in self._task.fields}
        return bool(self._task.success(SimpleNamespace(**fields))[0])
