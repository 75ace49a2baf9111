"""One control task, the Gymnasium environment."""

from __future__ import annotations

from functools import partial

from curiosity_gym.control.simulation import Simulation
from curiosity_gym.control.tasks import TASKS, ControlTask
from curiosity_gym.episodic_env import EpisodicEnv
from curiosity_gym.episodic_vector_env import EpisodicVectorEnv
from curiosity_gym.mujoco_viewer import MujocoViewer
from curiosity_gym.validation import check_at_least_one, check_choice


class ControlEnv(EpisodicEnv):
    """A task of the DeepMind Control Suite, rewarded only when it is solved.

    Description:
        The control environments of "Curiosity creates Diversity in Policy Search" (section 4.1).
        Physics, observations and goals are dm_control's own, bit for bit; reward, fixed start and
        target are the paper's:

        =================================== =========== ============ =======
        Id                                  `task`      observations actions
        =================================== =========== ============ =======
        `CuriosityControl-BallInCup-v0`     ball_in_cup 8            2
        `CuriosityControl-Finger-v0`        finger      12           2
        `CuriosityControl-Stacker-v0`       stacker     42           5
        =================================== =========== ============ =======

        `pip install "curiosity-search[control]"` installs what they need.

    Action Space:
        `Box(-1, 1, (A,), float32)`, a share of each actuator's strength. Actions outside are
        clipped; NaN and infinity are a `ValueError`.

    Observation Space:
        `Box` of shape `(O,)`, float32, unbounded: dm_control's observations, in its order.

    Behavior:
        `info["behavior"]`, of `behavior_space`, counted in 50 cells a dimension (`coverage_grid`).

    Rewards:
        `1 - t / horizon` on the step t that solves the task, and 0 on every other.

    Starting State:
        At rest and always the same; with `random_start` as dm_control draws it, target included,
        and drawn again where the task is already solved.

    Episode End:
        Terminated when the task is solved; truncated after `horizon` steps without it.

    Information:
        `behavior` (B,), float64, and `is_success`.

    Args:
        task: "ball_in_cup", "finger" or "stacker". The ids give it.
        horizon: Steps after which an episode is truncated, and the T of the reward `1 - t / T`.
        width: Of a frame (pixels).
        height: Of a frame (pixels).
        success_threshold: Of stacker alone: the least of dm_control's own reward that counts as
            success, from above 0 to 1; None: 0.1, as in the paper's code.
        random_start: Whether dm_control draws the start of each episode.
        render_mode: "rgb_array" or None; `gym.make` also takes "human", and opens a window.

    Raises:
        ValueError: If an argument is not what it may be.
        TypeError: If `success_threshold` is given for another task than stacker.
        gymnasium.error.DependencyNotInstalled: If the extra `control` is not installed.
    """

    settings = ("task", "success_threshold", "random_start", "width", "height")

    def __init__(
        self,
        task: str | None = None,
        *,
        horizon: int = 1000,
        width: int = 320,
        height: int = 240,
        success_threshold: float | None = None,
        random_start: bool = False,
        render_mode: str | None = None,
    ) -> None:
        check_choice(tuple(TASKS), task=task)
        check_at_least_one(horizon=horizon, width=width, height=height)
        assert task is not None
        own = {} if success_threshold is None else {"success_threshold": success_threshold}
        self.task = TASKS[task](random_start=random_start, **own)
        size = {"width": int(width), "height": int(height)}
        super().__init__(
            Simulation(self.task, 1),
            horizon=horizon,
            render_mode=render_mode,
            make_viewer=partial(MujocoViewer, self.task.model, **size),
        )


class ControlVectorEnv(EpisodicVectorEnv):
    """An `EpisodicVectorEnv` of `ControlEnv`; MuJoCo's threads step them all."""

    task: ControlTask
    single_class = ControlEnv
    settings = ControlEnv.settings
