"""CuriosityES from start to end, where its time goes, and PPO for scale."""

from __future__ import annotations

import time
from itertools import count

from stable_baselines3 import PPO

from benchmarks.measure import (
    Plan,
    Row,
    Stopwatch,
    Table,
    interleave,
    ratios,
    seconds,
    stage_rows,
)
from curiosity_algos import CuriosityES
from curiosity_algos.common.networks import single_torch_thread

MAZE = "CuriosityMaze-Hard-v0"
STAGES = ("ask", "evaluate", "score", "remember", "bonus updates", "tell", "rest")


def run(plan: Plan) -> list[Table]:
    """Total time and rate beside PPO's, then the stages of the same runs."""
    timesteps, ppo_timesteps = plan.size(1e6, 1.0), plan.size(4096, 64)
    seeds = count()
    runs: list[dict[str, float]] = []
    steps: list[int] = []

    def curiosity_es() -> float:
        model, stages = timed_run(timesteps, next(seeds))
        runs.append(stages)
        steps.append(model.num_timesteps)
        return sum(stages.values())

    CuriosityES(MAZE, seed=0).learn(1)
    ppo = PPO("MlpPolicy", MAZE, n_steps=min(2048, ppo_timesteps), seed=0, device="cpu")

    def learn_ppo() -> None:
        # As CuriosityES does: on busy cores torch's default makes PPO tens of times slower.
        with single_torch_thread():
            ppo.learn(ppo_timesteps)

    learn_ppo()
    tasks = {
        "CuriosityES": curiosity_es,
        "PPO": lambda: ppo_timesteps / seconds(learn_ppo),
    }
    figures = interleave(tasks, plan.repeats)
    rates = ratios(steps, figures["CuriosityES"])
    rows = [
        Row(f"CuriosityES, learn({timesteps:,.0f})", figures["CuriosityES"], "s", "<= 1.5"),
        Row("CuriosityES", rates, "steps/s"),
        Row("Stable-Baselines3's PPO", figures["PPO"], "steps/s"),
        Row("CuriosityES over PPO", ratios(rates, figures["PPO"]), "x"),
    ]
    notes = [
        "Another seed each repeat; machine code loaded before. Both train on one torch thread; "
        "CuriosityES also evaluates and scores on every core. PPO is another kind of algorithm, "
        "here only for scale."
    ]
    return [Table(f"learn: {MAZE}", rows, notes), _stages(runs)]


def timed_run(timesteps: float, seed: int) -> tuple[CuriosityES, dict[str, float]]:
    """A trained model, and its seconds by stage; they add up to the whole, construction too."""
    watch = Stopwatch()
    began = time.perf_counter()
    model = CuriosityES(MAZE, seed=seed)
    motivation = model._motivation
    watch.wrap(model._search, "ask", "ask")
    watch.wrap(model.evaluator, "evaluate", "evaluate")
    watch.wrap(motivation, "score", "score")
    watch.wrap(motivation, "_remember", "remember")
    watch.wrap(motivation, "update", "bonus updates")
    watch.wrap(model._search, "tell", "tell")
    model.learn(timesteps)
    elapsed = time.perf_counter() - began
    return model, {**watch.seconds, "rest": elapsed - sum(watch.seconds.values())}


def _stages(runs: list[dict[str, float]]) -> Table:
    notes = ["`rest` is construction, logging, coverage and the loop itself."]
    return Table("learn: where the time goes", stage_rows(STAGES, runs), notes)
