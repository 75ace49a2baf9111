"""The mazes in a plain loop, single and batched: `python examples/plain_gymnasium_loop.py`."""

from __future__ import annotations

import gymnasium as gym

import curiosity_gym  # noqa: F401  registers the ids


def main() -> None:
    """Act at random in one maze, then in 64 at once."""
    env = gym.make("CuriosityMaze-US-v0")
    env.action_space.seed(0)
    observation, info = env.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    x, y = info["position"]
    print(f"One robot ended at ({x:.1f}, {y:.1f}); goal reached: {info['is_success']}")
    env.close()

    envs = gym.make_vec("CuriosityMaze-US-v0", num_envs=64, vectorization_mode="vector_entry_point")
    envs.action_space.seed(0)
    observations, infos = envs.reset(seed=0)
    for _ in range(1000):
        observations, rewards, terminations, truncations, infos = envs.step(
            envs.action_space.sample()
        )
    farthest = abs(infos["position"] - infos["position"][0]).max()
    print(f"{len(observations)} robots spread over {farthest:.1f} units after 1000 steps")
    envs.close()


if __name__ == "__main__":
    main()
