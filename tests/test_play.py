"""The page that plays mazes in the browser computes what the packages do, bit for bit."""

import json
import re
import shutil
import subprocess

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos.experiments.pretrained import load_pretrained
from docs import play

N_STEPS = 1000
SCRIPT = """
const { Maze, act } = require(process.argv[1]);
const { constants, cases, sizes, horizon } = JSON.parse(require("fs").readFileSync(0, "utf8"));
console.log(JSON.stringify(cases.map(({ layout, lidar_range, actions, parameters }) => {
  const maze = new Maze(layout, { ...constants, lidar_range });
  const state = [...layout.start, 0, 0], states = [], seen = [];
  for (const action of actions) {
    maze.step(state, action);
    states.push([...state]);
    seen.push([...maze.observe(state)]);
  }
  const weights = Float32Array.from(parameters), robot = [...layout.start, 0, 0];
  const moves = [];
  while (moves.length < horizon && !maze.isAtGoal(robot)) {
    moves.push([...act(sizes, weights, maze.observe(robot))]);
    maze.step(robot, moves.at(-1));
  }
  return { states, seen, moves };
})));
"""
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
needs_chromium = pytest.mark.skipif(shutil.which("chromium") is None, reason="needs chromium")


@pytest.fixture(scope="module")
def data():
    return play.data()


def walk(env, rng):
    """Actions that are held for a while, some of them out of range, and what they come to."""
    actions = np.repeat(rng.uniform(-1.2, 1.2, (N_STEPS // 10, 2)), 10, axis=0).astype(np.float32)
    env.reset()
    states, seen = [], []
    for action in actions:
        observation, _, terminated, _, info = env.step(action)
        states.append([*info["position"], *info["velocity"]])
        seen.append(observation)
        assert not terminated
    return actions, np.array(states), np.array(seen)


@needs_node
def test_the_page_steps_as_the_kernel_does(data):
    rng = np.random.default_rng(0)
    envs = [gym.make(f"CuriosityMaze-{name}-v0") for name in play.BUILT_IN]
    walks = [walk(env, rng) for env in envs]
    algorithm = "CuriosityES, found by search"
    cases = [
        {
            "layout": data["mazes"][name],
            "lidar_range": env.unwrapped.lidar_range,
            "actions": actions.tolist(),
            "parameters": data["policies"][name][algorithm],
        }
        for name, env, (actions, *_) in zip(play.BUILT_IN, envs, walks, strict=True)
    ]
    told = {name: data[name] for name in ("constants", "sizes", "horizon")} | {"cases": cases}
    command = ["node", "-e", SCRIPT, str(play.SOURCE / "maze.js")]
    ran = subprocess.run(command, input=json.dumps(told), capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    for name, env, (_, states, seen), found in zip(
        play.BUILT_IN, envs, walks, json.loads(ran.stdout), strict=True
    ):
        np.testing.assert_array_equal(np.float32(found["states"]), states.astype(np.float32))
        np.testing.assert_array_equal(np.float32(found["seen"]), seen)
        policy, terminated, moves = load_pretrained("CuriosityES", env.spec.id), False, []
        observation, _ = env.reset()
        while not terminated:
            moves.append(policy.predict(observation, deterministic=True)[0])
            observation, _, terminated, truncated, _ = env.step(moves[-1])
            assert not truncated, name
        # The exponential of another library may round otherwise.
        np.testing.assert_allclose(found["moves"][:50], moves[:50], atol=1e-5)
        assert abs(len(found["moves"]) - len(moves)) < 0.1 * len(moves)


def test_the_page_asks_nobody_else(tmp_path):
    play.write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"index.html", "page.css", "page.js", "maze.js", "data.js"}
    for name in names:
        text = (tmp_path / name).read_text()
        assert not re.search(r"(https?:)?//[\w-]+\.\w", text), name
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 1e6


def test_the_page_has_every_policy_of_a_maze(data):
    known = {(algorithm, env) for algorithm, env in play.PRETRAINED if "Maze" in env}
    known = {(algorithm, env) for algorithm, env in known if env.startswith("CuriosityMaze-")}
    assert sum(map(len, data["policies"].values())) == len(known)
    for policies in data["policies"].values():
        assert next(iter(policies)).startswith("CuriosityES")
        for weights in policies.values():
            assert len(weights) == 1746
    ours = data["policies"]["US"]["CuriosityES, found by search"]
    vector = load_pretrained("CuriosityES", "CuriosityMaze-US-v0").vector
    np.testing.assert_array_equal(np.float32(ours), vector)


@needs_chromium
def test_the_page_plays_in_a_browser(tmp_path):
    play.write(tmp_path / "play")
    page = tmp_path / "play/index.html"
    loud = "<script>onerror = (text) => { document.title = text; };</script>"
    # Where time is virtual hardly a frame is drawn.
    hasty = "<script>while (!episode.ended) play(episode); say();</script>"
    text = page.read_text().replace("<main>", f"{loud}<main>")
    page.write_text(text.replace("</body>", f"{hasty}</body>"))
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    options += ["--no-first-run", "--disable-sync", f"--user-data-dir={tmp_path / 'user'}"]
    for width in (400, 1300):
        sized = [f"--window-size={width},900", "--virtual-time-budget=3000", "--dump-dom"]
        ran = subprocess.run(
            ["chromium", *options, *sized, page.as_uri()],
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert "<title>Play: curiosity-search</title>" in ran.stdout
        assert re.search(r"Arrived after \d+ steps", ran.stdout)
