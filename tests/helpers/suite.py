"""The oracle of the control tasks: dm_control's own environments, at fixed and random starts."""

from functools import cache
from types import SimpleNamespace

import numpy as np


@cache
def fixed_tasks():
    """dm_control's tasks, each with `initialize_episode` at the fixed start."""
    from dm_control.suite import ball_in_cup, finger, stacker

    class FixedBallInCup(ball_in_cup.BallInCup):
        def initialize_episode(self, physics):
            physics.named.data.qpos["ball_x"] = 0.0
            physics.named.data.qpos["ball_z"] = -0.05

    class FixedFinger(finger.Turn):
        def initialize_episode(self, physics):
            physics.named.model.site_pos["target"] = 0.3168727, 0.0, 0.45692778
            physics.named.model.site_size["target", 0] = 0.03
            for joint, angle in {"proximal": np.pi / 2, "distal": 0.0, "hinge": np.pi / 2}.items():
                physics.named.data.qpos[joint] = angle

    class FixedStacker(stacker.Stack):
        def initialize_episode(self, physics):
            physics.named.model.body_pos["target"] = 0.0, 0.0, 0.07
            physics.named.data.qpos["arm_root"] = np.pi / 2
            for axis, position in {"x": -0.3, "z": 0.04, "y": 0.0}.items():
                physics.named.data.qpos[f"box0_{axis}"] = position

    return SimpleNamespace(
        ball_in_cup=(ball_in_cup, ball_in_cup.get_model_and_assets(), FixedBallInCup(), 0.02),
        finger=(finger, finger.get_model_and_assets(), FixedFinger(target_radius=0.03), 0.02),
        stacker=(stacker, stacker.make_model(1), FixedStacker(1, fully_observable=True), 0.01),
    )


def make_reference(name):
    """dm_control's environment of a task, without a time limit."""
    from dm_control.rl import control

    suite, model, task, timestep = getattr(fixed_tasks(), name)
    physics = suite.Physics.from_xml_string(*model)
    return control.Environment(physics, task, control_timestep=timestep)


def make_random_reference(name, seed):
    """dm_control's environment of a task, which draws from what Gymnasium seeds with `seed`.

    Solved starts are drawn again.
    """
    from dm_control.rl import control

    random = np.random.RandomState(np.random.PCG64(np.random.SeedSequence(seed)))
    suite, model, _, timestep = getattr(fixed_tasks(), name)
    own = {
        "ball_in_cup": lambda: suite.BallInCup(random=random),
        "finger": lambda: suite.Turn(target_radius=0.03, random=random),
        "stacker": lambda: suite.Stack(1, fully_observable=True, random=random),
    }
    physics = suite.Physics.from_xml_string(*model)
    env = control.Environment(physics, own[name](), control_timestep=timestep)
    reset = env.reset

    def reset_unsolved():
        first = reset()
        while is_solved(name, env.task.get_reward(physics)):
            first = reset()
        return first

    env.reset = reset_unsolved
    return env


def flat(observation):
    """dm_control's observation in its own order, float32."""
    arrays = [np.ravel(value) for value in observation.values()]
    return np.concatenate(arrays).astype(np.float32)


def is_solved(name, reward):
    return reward >= 0.1 if name == "stacker" else reward > 0.0


def play_reference(name, actions):
    """Observations (T + 1, O) and whether each step is at the goal (T,), never stopping there."""
    env = make_reference(name)
    observations, solved = [flat(env.reset().observation)], []
    for action in actions:
        timestep = env.step(action.astype(np.float64))
        observations.append(flat(timestep.observation))
        solved.append(is_solved(name, timestep.reward))
    return np.array(observations), np.array(solved)


def make_actions(kind, n_steps, n_actions, seed=0):
    """Independent uniform actions, or bang-bang ones held for ten steps."""
    rng = np.random.default_rng(seed)
    if kind == "uniform":
        return rng.uniform(-1.0, 1.0, (n_steps, n_actions)).astype(np.float32)
    held = rng.choice([-1.0, 1.0], (-(-n_steps // 10), n_actions))
    return np.repeat(held, 10, axis=0)[:n_steps].astype(np.float32)
