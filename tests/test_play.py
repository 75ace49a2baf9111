"""The page that plays mazes in the browser computes what the packages do."""

import base64
import json
import re
import shutil
import subprocess

import gymnasium as gym
import numpy as np
import pytest
from browser import needs_chromium, run_in_page

from curiosity_algos.evaluation.evaluator import make_evaluator
from curiosity_algos.experiments.pretrained import load_pretrained
from docs import play

N_STEPS = 1000
STRIDE = 10
SEARCHED, TRAINED = "CuriosityES, found by search", "PPO, trained from many starts"
COMPARED = {SEARCHED: "CuriosityES", TRAINED: "PPO"}
SCRIPT = """
const { Maze, act } = require(process.argv[1]);
const { constants, cases, horizon } = JSON.parse(require("fs").readFileSync(0, "utf8"));
console.log(JSON.stringify(cases.map(({ layout, lidar_range, actions, policies }) => {
  const maze = new Maze(layout, { ...constants, lidar_range });
  const state = [...layout.start, 0, 0], states = [], seen = [];
  for (const action of actions) {
    maze.step(state, action);
    states.push([...state]);
    seen.push([...maze.observe(state)]);
  }
  const episodes = policies.map((network) => {
    const robot = [...layout.start, 0, 0], moves = [];
    network.weights = Float32Array.from(network.weights);
    while (moves.length < horizon && !maze.isAtGoal(robot)) {
      moves.push([...act(network, maze.observe(robot))]);
      maze.step(robot, moves.at(-1));
    }
    return { moves, end: robot.slice(0, 2) };
  });
  return { states, seen, episodes };
})));
"""
needs_node = pytest.mark.skipif(shutil.which("node") is None, reason="needs node")


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


def unpacked(known):
    """The weights of a policy, or of several, (n, n_parameters)."""
    weights = np.frombuffer(base64.b64decode(known["weights"]), dtype="<f4")
    return weights.reshape(len(known["squares"]), -1) if "squares" in known else weights


@needs_node
def test_the_page_steps_as_the_kernel_does(data):
    rng = np.random.default_rng(0)
    envs = [gym.make(f"CuriosityMaze-{name}-v0") for name in play.BUILT_IN]
    walks = [walk(env, rng) for env in envs]
    cases = []
    for name, env, (actions, *_) in zip(play.BUILT_IN, envs, walks, strict=True):
        known, archive = data["policies"][name], data["archives"][name]
        chosen = [known[kind] | {"weights": unpacked(known[kind]).tolist()} for kind in COMPARED]
        chosen += [
            {"sizes": archive["sizes"], "weights": weights.tolist()}
            for weights in unpacked(archive)[::STRIDE]
        ]
        cases.append(
            {
                "layout": data["mazes"][name],
                "lidar_range": env.unwrapped.lidar_range,
                "actions": actions.tolist(),
                "policies": chosen,
            }
        )
    given = {name: data[name] for name in ("constants", "horizon")} | {"cases": cases}
    command = ["node", "-e", SCRIPT, str(play.SOURCE / "maze.js")]
    ran = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    for name, env, (_, states, seen), played in zip(
        play.BUILT_IN, envs, walks, json.loads(ran.stdout), strict=True
    ):
        np.testing.assert_array_equal(np.float32(played["states"]), states.astype(np.float32))
        np.testing.assert_array_equal(np.float32(played["seen"]), seen)
        episodes = dict(zip(COMPARED, played["episodes"], strict=False))
        ends = np.array([each["end"] for each in played["episodes"][len(COMPARED) :]]) // play.SIDE
        squares = np.array(data["archives"][name]["squares"][::STRIDE])
        assert (ends == squares).all(axis=1).mean() > 0.9, name
        for kind, algorithm in COMPARED.items():
            found, moves = episodes[kind]["moves"], moves_of(algorithm, env)
            # The exponential of another library may round otherwise.
            np.testing.assert_allclose(found[:50], moves[:50], atol=1e-5)
            assert abs(len(found) - len(moves)) < 0.1 * len(moves), (name, kind)


def moves_of(algorithm, env):
    """The actions of the package's policy until it comes to the goal."""
    policy, terminated, moves = load_pretrained(algorithm, env.spec.id), False, []
    observation, _ = env.reset()
    while not terminated:
        moves.append(policy.predict(observation, deterministic=True)[0])
        observation, _, terminated, truncated, _ = env.step(moves[-1])
        assert not truncated, (algorithm, env.spec.id)
    return moves


def test_the_page_asks_nobody_else(tmp_path):
    play.write(tmp_path)
    names = {path.name for path in tmp_path.iterdir()}
    mazes = {"index.html", "page.css", "page.js", "maze.js", "data.js"}
    assert names == mazes | {"robots.html", "robots.js", "robots_data.js"}
    for name in names:
        text = (tmp_path / name).read_text()
        assert not re.search(r"(https?:)?//[\w-]+\.\w", text), name
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) < 3e6


def test_the_page_has_every_policy_of_a_maze(data):
    known = [env for _, env in play.PRETRAINED if env.startswith("CuriosityMaze-")]
    assert sum(map(len, data["policies"].values())) == len(known)
    for policies in data["policies"].values():
        assert list(policies)[:2] == list(COMPARED)
        for kind, network in policies.items():
            assert len(unpacked(network)) == (21506 if kind == TRAINED else 1746)
    ours = unpacked(data["policies"]["US"][SEARCHED])
    vector = load_pretrained("CuriosityES", "CuriosityMaze-US-v0").vector
    np.testing.assert_array_equal(ours, vector)


def test_policies_of_an_archive_end_in_their_squares(data):
    for name, archive in data["archives"].items():
        evaluator = make_evaluator(f"CuriosityMaze-{name}-v0", {"net_arch": []})
        rollouts = evaluator.evaluate(unpacked(archive))
        ends, squares = rollouts.behaviors[:, :2] // archive["side"], np.array(archive["squares"])
        # All on the machine that searched; the exponential of another may round otherwise.
        assert (ends == squares).all(axis=1).mean() > 0.95, name
        assert len(np.unique(squares, axis=0)) == len(squares)
        layout = data["mazes"][name]
        assert (squares * archive["side"] < [layout["width"], layout["height"]]).all()


PLAYED = """
const said = [];
onerror = (text) => said.push(text);
while (!episode.ended) play(episode);
say();
said.push(element.said.textContent);
const box = canvas.getBoundingClientRect();
const send = (kind, x, y) => canvas.dispatchEvent(new PointerEvent(kind, {
  clientX: box.left + x * box.width, clientY: box.top + (1 - y) * box.height, pointerId: 1 }));
canvas.setPointerCapture = () => {};
send("pointerdown", 0.5, 0.025); send("pointermove", 0.25, 0.025); send("pointerup", 0.25, 0.025);
said.push(start.map(Math.round).join());
element.draw.click();
const walls = maze.walls.length;
send("pointerdown", 0.6, 0.01); send("pointermove", 0.62, 0.04); send("pointerup", 0.62, 0.04);
send("pointerdown", 0.2, 0.01); send("pointermove", 0.3, 0.04); send("pointerup", 0.3, 0.04);
said.push(maze.walls.length - walls, element.said.textContent);
element.said.textContent = "";
send("pointerdown", 0.48, 0.01); send("pointermove", 0.52, 0.04); send("pointerup", 0.52, 0.04);
said.push(element.said.textContent);
element.draw.click();
element.clear.click();
element.policy.value = ARCHIVE;
element.policy.dispatchEvent(new Event("change"));
element.said.textContent = "";
told = 0;
say();
said.push(element.said.textContent, element.hundred.disabled);
const [i, j] = archives[element.maze.value].squares.at(-1);
const [x, y] = [i + 0.4, j + 0.6].map((part) => part * archive().side / maze.width);
send("pointerdown", x, y); send("pointermove", x / 2, y); send("pointerup", x / 2, y);
while (!episode.ended) play(episode);
const end = episode.state.slice(0, 2).map((part) => Math.floor(part / archive().side));
said.push(elite, end.join() === `${i},${j}`);
const key = (name, more) =>
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: name, ...more }));
elite = null;
for (const name of ["ArrowUp", "ArrowUp", "ArrowLeft"]) key(name);
const square = archive().squares[elite];
key("ArrowRight");
said.push(isYou(), square, archive().squares[elite]);
element.policy.selectedIndex = 0;
element.policy.dispatchEvent(new Event("change"));
hundred();
for (const one of others.episodes) while (!one.ended) play(one);
told = 0;
say();
said.push(element.said.textContent, document.documentElement.scrollWidth <= innerWidth);
for (const name of Object.keys(policies[element.maze.value]).slice(0, 2)) {
  element.policy.value = name;
  element.policy.dispatchEvent(new Event("change"));
  element.disturb.click();
  hundred();
  for (const one of others.episodes) while (!one.ended) play(one);
  said.push(others.episodes.filter((one) => one.arrived).length);
  element.disturb.click();
}
key("ArrowLeft");
said.push(actionOf(episode.seen).join(), element.hundred.disabled);
key("r", { ctrlKey: true });
document.body.dataset.said = JSON.stringify(said);
"""


@needs_chromium
@pytest.mark.parametrize("width", [500, 1300])
def test_the_page_plays_in_a_browser(width, data, tmp_path):
    n_elites = len(data["archives"]["US"]["squares"])
    play.write(tmp_path / "play")
    said = run_in_page(tmp_path / "play" / "index.html", PLAYED, width)
    arrived, start, n_walls, refused, buried, *chosen = said
    asked, is_idle, elite, is_there, is_you, square, beside, *chosen = chosen
    hundred, fits, n_found, n_trained, action, is_disabled = chosen
    assert re.fullmatch(r"Arrived after \d+ steps: a return of 0\.\d+\.", arrived)
    assert start == "50,5"
    assert n_walls == 1  # the other one would bury the start
    assert refused == buried == "A wall must leave the start free, and that of the maze."
    assert asked.startswith("Click a square, or use the arrow keys: a policy plays whose episode")
    assert is_idle
    assert elite == n_elites - 1
    assert is_there
    assert not is_you
    assert beside[0] > square[0]
    assert re.search(r"Of 100 starts nearby \d+ arrived\.$", hundred)
    assert fits
    assert n_found < 80 < n_trained  # where they are disturbed
    assert action == "-1,0"
    assert is_disabled


def test_alone_the_page_links_to_no_other(tmp_path):
    play.write(tmp_path / "alone")
    play.write(tmp_path / "beside", is_alone=False)
    for page, n_links in (("index.html", 2), ("robots.html", 1)):
        alone, beside = ((tmp_path / each / page).read_text() for each in ("alone", "beside"))
        assert "../" not in alone
        assert beside.count('<a href="../') == n_links
        assert alone.count("<a href=") == 1


def test_recorded_robots_arrive_as_they_say():
    for title, film in play.robots().items():
        numbers = np.frombuffer(base64.b64decode(film["pictures"]), dtype="<i2") * 1e-3
        pictures = numbers.reshape(sum(film["counts"]), len(film["radii"]), 2, 3)
        torsos = pictures[np.cumsum(film["counts"]) - 1, 0].mean(axis=1)
        distances = np.hypot(*(torsos[:, :2] - film["world"]["goal"]).T)
        is_near = distances <= film["world"]["goal_radius"] + 0.1  # whose torso is of several parts
        np.testing.assert_array_equal(is_near, film["success"], err_msg=title)
        expected = 1 + np.ceil(np.array(film["lengths"]) / film["stride"])
        np.testing.assert_array_equal(film["counts"], expected)


SEEN = """
const said = [];
onerror = (text) => said.push(text);
for (const name of Object.keys(ROBOTS)) {
  element.policy.value = name;
  element.policy.dispatchEvent(new Event("change"));
  element.start.value = element.start.max;
  element.start.dispatchEvent(new Event("input"));
  element.time.value = element.time.max;
  const before = canvas.toDataURL();
  show();
  said.push(before !== canvas.toDataURL());
  said.push(element.said.textContent, torsoAt(episode, element.time.valueAsNumber));
}
said.push(document.documentElement.scrollWidth <= innerWidth);
document.body.dataset.said = JSON.stringify(said);
"""


@needs_chromium
@pytest.mark.parametrize("width", [500, 1300])
def test_the_page_shows_robots_in_a_browser(width, tmp_path):
    play.write(tmp_path / "play")
    *said, fits = run_in_page(tmp_path / "play" / "robots.html", SEEN, width)
    for (title, film), is_drawn, text, torso in zip(
        play.robots().items(), said[::3], said[1::3], said[2::3], strict=True
    ):
        assert is_drawn
        n, arrived = len(film["counts"]), sum(film["success"])
        assert text.startswith(f"Start {n} of {n}: ")
        assert text.endswith(f"{arrived} of {n} arrive.")
        assert str(film["lengths"][-1]) in text
        distance = np.hypot(*np.subtract(torso[:2], film["world"]["goal"]))
        assert (distance < film["world"]["goal_radius"] + 0.1) == film["success"][-1], title
    assert fits


def test_archives_are_searched_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(play, "ARCHIVES", tmp_path / "archives.npz")
    play.search(1e4)
    for archive in play.archives().values():
        assert archive["sizes"] == [36, 2]
        assert unpacked(archive).shape == (len(archive["squares"]), 74)


def test_robots_are_recorded_anew(tmp_path, monkeypatch):
    pytest.importorskip("mujoco")
    from docs import play_robots

    path, shown = tmp_path / "robots.npz", ("PPO", play_robots.ANT, 1, 50)
    monkeypatch.setattr(play_robots, "EPISODES", path)
    monkeypatch.setattr(play_robots, "SHOWN", {"Ant": shown})
    monkeypatch.setattr(play, "EPISODES", path)
    play_robots.record()
    film = play.robots()["Ant"]
    assert film["counts"] == [1 + -(-film["lengths"][0] // 50)]
    assert (len(film["radii"]), film["stride"], film["world"]["goal"]) == (13, 50, [18.0, 0.0])
