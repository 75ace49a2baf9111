"""Solve a control task and film the best policy: `python examples/control_task.py`.

Needs the extra `control`, and EGL or OSMesa for the pictures where there is no display.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import gymnasium as gym
import typer
from PIL import Image

from curiosity_algos import CuriosityES


def film(model: CuriosityES, env_id: str, path: Path, stride: int = 4) -> float:
    """One episode of the best policy as a GIF, a frame every `stride` steps; its return."""
    env = gym.make(env_id, render_mode="rgb_array")
    observation, _ = env.reset()
    frames, total, t, done = [env.render()], 0.0, 0, False
    while not done:
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, terminated, truncated, _ = env.step(action)
        total, t, done = total + float(reward), t + 1, terminated or truncated
        if done or t % stride == 0:
            frames.append(env.render())
    frame_ms = 1000 * stride / env.metadata["render_fps"]
    env.close()
    first, *others = [Image.fromarray(frame) for frame in frames]
    first.save(path, save_all=True, append_images=others, duration=frame_ms, loop=0)
    return total


def main(
    env_id: Annotated[str, typer.Option("--env")] = "CuriosityControl-Finger-v0",
    timesteps: float = 1e6,
    seed: int = 0,
    out: Path = Path("runs/control"),
) -> None:
    """Train CuriosityES on one of the three tasks and write a GIF."""
    out.mkdir(parents=True, exist_ok=True)
    print(f"CuriosityES on {env_id}, seed {seed}, {timesteps:,.0f} environment steps")
    model = CuriosityES(env_id, seed=seed)
    model.learn(timesteps, progress_bar=True)
    if model.first_success_timesteps is None:
        print("The task was not solved.")
    else:
        print(f"First solved after {model.first_success_timesteps:,} environment steps.")
    print(f"Best return: {model.best_return:.3f}")
    total = film(model, env_id, out / "best_policy.gif")
    print(f"Filmed an episode of return {total:.3f}: {out / 'best_policy.gif'}")


if __name__ == "__main__":
    typer.run(main)
