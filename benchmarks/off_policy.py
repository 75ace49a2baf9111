"""What curiosity costs TD3: TD3ICM beside Stable-Baselines3's TD3, and where its time goes."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3 import SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecMonitor

from benchmarks.measure import (
    Figures,
    Plan,
    Row,
    Stopwatch,
    Table,
    Task,
    add_peer,
    interleave,
    ratios,
    seconds,
)
from benchmarks.products import products_of_errors
from benchmarks.roofline import products_task
from curiosity_algos import TD3ICM, BonusReplayBuffer, BonusVecEnvWrapper, GymnasiumVecEnv
from curiosity_algos.algorithms import td3_icm
from curiosity_algos.common.networks import single_torch_thread
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_gym.compiled import ThreadPool

MAZE = "CuriosityMaze-US-v0"
EIGHT = "SBX's TD3 + ICM, 8 environments"
N_STEPS = 200
"""Steps of all environments between two trainings of SBX's."""
SAME_STEP: dict[str, Any] = {
    "vectorization_mode": "vector_entry_point",
    "autoreset_mode": AutoresetMode.SAME_STEP,
}
TD3_SETTINGS: dict[str, Any] = {
    "learning_rate": 5e-5,
    "learning_starts": 10_000,
    "batch_size": 128,
    "train_freq": (1, "episode"),
    "gradient_steps": -1,
    "action_noise": NormalActionNoise(np.zeros(2), 0.1 * np.ones(2)),
    "policy_kwargs": {"net_arch": td3_icm.NET_ARCH},
}
"""Those that SB3's TD3 has in common with TD3ICM."""
SCORED = "rewards of samples"
STAGES = ("environment", SCORED, "bonus updates", "actor and critic", "rest")


class Stored(RunSpec):
    """A run of SAC whose bonus stays as it was collected.

    It is here because the processes of a sweep cannot import the script that was started.
    """

    def make(self) -> BaseAlgorithm:
        """A model that has not trained."""
        venv = BonusVecEnvWrapper(
            self._make_env(),
            bonus=self.bonus,
            weight=1.0,
            norm_reward=False,
            seed=self.seed,
            device="cpu",
        )
        # Copied, as SAC writes into its `policy_kwargs`.
        return SAC("MlpPolicy", venv, seed=self.seed, **deepcopy(self.settings))


def make_td3(**changes: Any) -> TD3:
    """SB3's TD3 with the networks, the noise and the schedule that TD3ICM has."""
    return TD3("MlpPolicy", gym.make(MAZE), **(TD3_SETTINGS | {"device": "cpu"} | changes))


def run(plan: Plan) -> list[Table]:
    """Rates of both, an episode in turns, then the stages of TD3ICM's episodes."""
    n_steps = plan.size(2000, 16)
    changes = {
        "learning_starts": 0,
        "buffer_size": 50 * n_steps,
        "seed": 0,
        **_training(plan, n_steps),
    }
    icm, td3 = TD3ICM(MAZE, device="cpu", **changes), make_td3(**changes)
    runs: list[dict[str, float]] = []
    watch = watched(icm)

    def rate(model: TD3) -> float:
        steps_per_second, elapsed = learn(model, n_steps)
        if model is icm:
            runs.append({**watch.seconds, "rest": elapsed - sum(watch.seconds.values())})
        watch.seconds.clear()
        return steps_per_second

    for model in (icm, td3):
        rate(model)
    runs.clear()
    names = "TD3ICM", "Stable-Baselines3's TD3"
    tasks = {names[0]: lambda: rate(icm), names[1]: lambda: rate(td3)}
    tasks["products"] = products_task(plan, ThreadPool(1), 1)
    figures = interleave(tasks, plan.repeats)
    rows = [
        *(Row(name, figures[name], "steps/s") for name in names),
        Row("TD3ICM over TD3", ratios(figures[names[0]], figures[names[1]]), "x", ">= .85"),
    ]
    notes = [
        "An episode each repeat, and as many gradient steps; the same networks, batches and noise; "
        "both train on one torch thread."
    ]
    floor = products_of_errors(icm.replay_buffer.bonus, n_steps * icm.batch_size)
    floors = [floor / rate for rate in figures["products"]]
    tables = [Table(f"td3: {MAZE}", rows, notes), _stages(runs, floors)]
    return [*tables, _compiled_learner(plan)]


def _training(plan: Plan, n_steps: int) -> dict[str, Any]:
    """When `learn` of so many steps trains: after its episode, which is long for a quick look."""
    return {"train_freq": (n_steps, "step")} if plan.quick else {}


def _compiled_learner(plan: Plan) -> Table:
    """Rates of SBX's TD3, whose learner is compiled, alone and with our replay buffer."""
    n_steps = plan.size(4000, 32)
    changes = {"learning_starts": plan.size(400, 0), "seed": 0, **_training(plan, n_steps)}

    def task(model: BaseAlgorithm) -> Task:
        learn(model, n_steps)  # what is compiled, is now
        return lambda: learn(model, n_steps)[0]

    tasks = {
        "TD3ICM": task(TD3ICM(MAZE, device="cpu", **changes)),
        "Stable-Baselines3's TD3": task(make_td3(**changes)),
        "Stable-Baselines3's TD3 + ICM, 32 environments, an update every 8 steps": task(
            make_batched(TD3, n_envs=32, steps_per_update=8)
        ),
    }
    notes = ["Networks of 32 and 32, batches of 128, and a training of SBX's every 200 steps."]
    alone = "SBX's TD3"

    def sbx_task(**settings: Any) -> Task:
        import sbx

        return task(make_batched(sbx.TD3, **settings))

    add_peer(tasks, notes, alone, lambda: sbx_task(n_envs=1, has_bonus=False))
    if alone in tasks:
        tasks |= {
            f"{alone} + ICM": sbx_task(n_envs=1),
            EIGHT: sbx_task(n_envs=8),
            f"{EIGHT}, an update every 4 steps": sbx_task(n_envs=8, steps_per_update=4),
        }
    figures = interleave(tasks, plan.repeats)
    rows = [Row(name, figures[name], "steps/s") for name in tasks]
    if EIGHT in figures:
        times = ratios(figures[EIGHT], figures["TD3ICM"])
        rows.append(Row(f"{EIGHT} over TD3ICM", times, "x", ">= 5"))
    return Table("td3: a compiled learner", rows, notes)


def learn(model: BaseAlgorithm, n_steps: int) -> tuple[float, float]:
    """Steps a second of so many more steps, or the rest of their episode, and seconds."""
    before = model.num_timesteps
    # As TD3ICM does: on busy cores torch's default makes small batches tens of times slower.
    with single_torch_thread():
        elapsed = seconds(lambda: model.learn(n_steps, reset_num_timesteps=False))
    return (model.num_timesteps - before) / elapsed, elapsed


def make_batched(
    algorithm: type[BaseAlgorithm],
    *,
    n_envs: int,
    steps_per_update: int = 1,
    has_bonus: bool = True,
) -> BaseAlgorithm:
    """A TD3 with the paper's networks and batches, that trains about every `N_STEPS`."""
    n_calls = N_STEPS // n_envs
    return algorithm(
        "MlpPolicy",
        VecMonitor(GymnasiumVecEnv(gym.make_vec(MAZE, num_envs=n_envs, **SAME_STEP))),
        learning_starts=400,
        batch_size=128,
        train_freq=n_calls,
        gradient_steps=n_calls * n_envs // steps_per_update,
        policy_kwargs={"net_arch": td3_icm.NET_ARCH},
        seed=0,
        device="cpu",
        replay_buffer_class=BonusReplayBuffer if has_bonus else None,
        replay_buffer_kwargs={"bonus": "icm"} if has_bonus else None,
    )


def _stages(runs: list[dict[str, float]], floors: Figures) -> Table:
    """Where the time of each run goes; `floors` are seconds of the products of its rewards."""
    totals = [sum(run.values()) for run in runs]
    spent = {stage: [run[stage] for run in runs] for stage in STAGES}
    of_roof = {SCORED: ratios(floors, spent[SCORED])}
    rows = [
        *(Row(stage, spent[stage], "s", of_roof=of_roof.get(stage, [])) for stage in STAGES),
        Row("all stages", totals, "s"),
    ]
    for stage in STAGES:
        shares = [100.0 * share for share in ratios(spent[stage], totals)]
        rows.append(Row(f"share of {stage}", shares, "%"))
    notes = [
        "`rest` is acting, storing, logging and the loop itself. The roof of rewards is the time "
        "of their matrix products at the rate of large ones, on one thread."
    ]
    return Table("td3: where TD3ICM's time goes", rows, notes)


def watched(model: TD3ICM) -> Stopwatch:
    """Times the stages of a model; each call of TD3's training holds those of its samples."""
    watch = Stopwatch()
    watch.wrap(model.env, "step", "environment")
    watch.wrap(model.replay_buffer.bonus, "score", SCORED)
    watch.wrap(model.replay_buffer, "train_bonus", "bonus updates")
    watch.wrap(model, "train", "actor and critic")
    return watch
