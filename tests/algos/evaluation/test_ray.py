"""A search on a Ray cluster is the search of a single process, whatever becomes of the cluster."""

import os
import re
import sys
import threading
import time

import gymnasium as gym
import numpy as np
import pytest
from scripts import run_python

from curiosity_algos import AURORA, NSES, CuriosityES, make_evaluator
from curiosity_gym import MazeLayout

pytestmark = pytest.mark.extra("ray")
ray = pytest.importorskip("ray")
# What follows cannot be imported without it: hence the E402.

from ray.cluster_utils import Cluster  # noqa: E402

from curiosity_algos.evaluation import ray as ray_evaluator  # noqa: E402
from curiosity_algos.evaluation.base import Evaluator  # noqa: E402
from curiosity_algos.evaluation.ray import RayEvaluator  # noqa: E402
from curiosity_algos.evaluation.ray_worker import Generation  # noqa: E402

ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import tests

POPULATION = 12
NODE = {"num_cpus": 1, "resources": {"node": 1}}
ON_HEAD = {"num_cpus": 0.1, "resources": {"head": 0.1}}


@pytest.fixture(scope="module")
def cluster():
    """A head for the workers that tests share; nodes come and go."""
    # Its hooks crash other tests' forks: from 3.13 on a child frees what they hold, a gRPC client.
    head = {"num_cpus": 1, "resources": {"head": 1}}
    made = Cluster(True, head_node_args=head, shutdown_at_exit=False)
    ray.init(address=made.address, log_to_driver=False)
    yield made
    ray.shutdown()
    made.shutdown()


@pytest.fixture
def nodes(cluster):
    """Two nodes with a processor each, those that a test has removed put back."""
    while len(cluster.worker_nodes) < 2:
        cluster.add_node(**NODE)
    cluster.wait_for_nodes()
    return list(cluster.worker_nodes)


@pytest.fixture
def make_there(cluster, make_easy_maze):
    """Makes evaluators of the tests' maze on the head, as many workers as it is asked for."""

    def make(**given):
        layout = MazeLayout("corridor", 40, 6, (8, 3), (16, 3), [])
        env = gym.make("CuriosityMaze-v0", layout=layout, horizon=64)
        return RayEvaluator(env, {"net_arch": [4]}, **ON_HEAD | {"n_workers": 2} | given)

    return make


@pytest.fixture
def one_each(monkeypatch):
    """`evaluator="ray"` plays one shard at a time, where it would play one on each processor."""
    monkeypatch.setattr(RayEvaluator, "_n_wanted", lambda self: self.n_workers or 1)


def make_cartpole():
    return gym.make("CartPole-v1", max_episode_steps=30)


def make_population(evaluator, n=POPULATION):
    rng = np.random.default_rng(0)
    return rng.normal(0, 1, (n, evaluator.n_parameters)).astype(np.float32)


class Eventful(Evaluator):
    """An evaluator with which something happens before it plays."""

    def __init__(self, evaluator, happen):
        self._evaluator = evaluator
        self._happen = happen
        self.n_parameters = evaluator.n_parameters

    def evaluate(self, parameters, seed=None):
        self._happen()
        return self._evaluator.evaluate(parameters, seed)


@pytest.fixture
def here(make_there):
    """The evaluator of the tests' maze that `make_there` makes, in this process."""
    return make_there().local


@pytest.fixture
def eventful(here):
    """Functions that make an evaluator of the maze, with which something happens."""

    def make(happen):
        return lambda evaluator=here: Eventful(evaluator, happen)

    return make


class Times:
    """Does something the first n times that a shard is played; files remember it."""

    def __init__(self, folder, n, what):
        self._files = [folder / f"done {i}" for i in range(n)]
        self._what = what

    def __call__(self):
        for file in self._files:
            try:
                file.touch(exist_ok=False)
            except FileExistsError:
                continue
            self._what()
            return


def die():
    os._exit(1)


def raise_an_error():
    raise ValueError("`env` is out of order.")


class Far(gym.Wrapper):
    """A wrapper of a script."""

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, reward + 2.0, *rest


def make_vec():
    return gym.make_vec("CartPole-v1", 4, vectorization_mode="vector_entry_point")


ENVIRONMENTS = {
    "a wrapper of a script": lambda: Far(make_cartpole()),
    "an id that was registered here": "Far-v0",
    "a vector env with one generator": lambda: make_evaluator(make_vec()),
}


# -- the same bits --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("algorithm", "changes"),
    [
        pytest.param(CuriosityES, {}, marks=pytest.mark.nightly),
        (CuriosityES, {"n_states": None, "bonus": "icm"}),
        pytest.param(AURORA, {}, marks=pytest.mark.nightly),
    ],
)
def test_a_search_is_that_of_one_process(
    make_there, algorithm, changes, make_model, make_easy_maze, assert_same_run, capsys
):
    there = make_model(algorithm, make_easy_maze(), evaluator=make_there(), verbose=1, **changes)
    here = make_model(algorithm, make_easy_maze(), **changes)
    there.learn(1500, progress_bar=True)
    here.learn(1500)
    shown = capsys.readouterr()
    assert re.search(r"workers=[12]\b", shown.err)
    assert "workers" in shown.out
    assert there.generation > 3
    assert 1 <= there.n_workers <= 2
    assert_same_run(there, here)


@pytest.mark.parametrize(("n_workers", "shard_size"), [(1, None), (2, 5), (4, 1)])
def test_so_are_trajectories_with_any_number_of_workers(
    n_workers, shard_size, make_there, here, assert_same_rollouts
):
    there = make_there(n_workers=n_workers, shard_size=shard_size)
    one, other = (each.evaluate(make_population(here), 0) for each in (there, here))
    assert_same_rollouts(one, other)
    assert 1 <= there.n_live <= n_workers
    one.returns[:] = 0.0  # as of any evaluator


@pytest.mark.parametrize("kind", ENVIRONMENTS)
def test_so_are_those_of_any_environment(kind, cluster, monkeypatch, assert_same_rollouts):
    monkeypatch.setattr(gym.envs.registration, "registry", dict(gym.registry))
    gym.register("Far-v0", entry_point=lambda: Far(make_cartpole()))
    env = ENVIRONMENTS[kind]
    there = RayEvaluator(env, n_workers=1, **ON_HEAD)
    here = env() if "generator" in kind else make_evaluator(env)
    population = make_population(here, 11)
    assert_same_rollouts(there.evaluate(population, 0), here.evaluate(population, 0))


def test_a_search_goes_on_across_backends(
    one_each, cluster, make_model, make_easy_maze, assert_same_run, tmp_path
):
    whole = make_model(CuriosityES, make_easy_maze()).learn(3000)
    model = make_model(CuriosityES, make_easy_maze(), evaluator="ray").learn(1500)
    model.save(tmp_path / "model")
    loaded = CuriosityES.load(tmp_path / "model", make_easy_maze(), evaluator="auto")
    loaded.learn(3000 - loaded.num_timesteps, reset_num_timesteps=False)
    assert (model.n_workers, loaded.n_workers) == (1, None)
    whole.learn(loaded.num_timesteps - whole.num_timesteps, reset_num_timesteps=False)
    assert_same_run(loaded, whole)


def test_a_process_that_plays_a_maze_imports_no_pytorch(make_there, tmp_path):
    """What CuriosityES asks of it, in a process that is not of Ray but does what Ray's do."""
    there = make_there()
    model = CuriosityES("CuriosityMaze-US-v0", population_size=6)
    summarizers = ray.cloudpickle.dumps(model._summarizers(POPULATION))
    generation = Generation(there._packed, make_population(there), 0, summarizers)
    file = tmp_path / "generation"
    file.write_bytes(ray.cloudpickle.dumps(generation))
    code = (
        "import pathlib, pickle, sys\n"
        "from curiosity_algos.evaluation.ray_worker import play_shard\n"
        f"generation = pickle.loads(pathlib.Path({str(file)!r}).read_bytes())\n"
        f"worker, rollouts = play_shard(generation, slice(0, {POPULATION}))\n"
        "heavy = ('torch', 'stable_baselines3', 'pandas', 'matplotlib')\n"
        "print(rollouts.lengths.tolist(), [name for name in heavy if name in sys.modules])\n"
    )
    lengths = there.local.evaluate(generation.parameters, 0).lengths.tolist()
    assert run_python(code) == f"{lengths} []\n"


# -- errors ---------------------------------------------------------------------------------------


def test_errors_are_those_of_the_evaluator(tmp_path, eventful, here, assert_same_rollouts):
    there = RayEvaluator(eventful(Times(tmp_path, 1, raise_an_error)), n_workers=1, **ON_HEAD)
    population = make_population(there)
    with pytest.raises(ValueError, match=r"^`env` is out of order.$"):
        there.evaluate(population, 0)
    assert_same_rollouts(there.evaluate(population, 0), here.evaluate(population, 0))


def test_a_worker_without_its_environment_says_so(cluster):
    def make():
        if os.getpid() != driver:
            raise ImportError("No module named 'simulator'")
        return make_evaluator(make_cartpole)

    driver = os.getpid()
    there = RayEvaluator(make, n_workers=1, **ON_HEAD)
    with pytest.raises(RuntimeError, match=r"make its environment: No module named 'simulator'$"):
        there.evaluate(make_population(there), 0)


def test_a_bonus_that_cannot_be_sent_says_so(make_there, make_model, make_easy_maze):
    model = make_model(CuriosityES, make_easy_maze(), evaluator=make_there(), n_states=None)
    model.trained_bonus.lock = threading.Lock()
    with pytest.raises(ValueError, match="`bonus` must be one that can be pickled"):
        model.learn(1)


MADE = "`env` must be an id or a function that makes the env"


@pytest.mark.parametrize(
    ("env", "given", "message"),
    [
        (make_cartpole, {"shard_size": 0.5}, "`shard_size` must be a whole number of at least 1"),
        (make_cartpole, {"num_cpus": 0}, "`num_cpus` must be"),
        (make_cartpole, {"timeout": -1}, "`timeout` must be"),
        (make_cartpole, {"resources": {"GPU": 1}}, "`resources` must be what Ray takes as such: U"),
        (make_cartpole(), {}, MADE),
        (lambda event=threading.Event(): make_cartpole(), {}, MADE),  # noqa: B008  # cannot travel
    ],
)
def test_errors_name_the_argument(env, given, message):
    with pytest.raises(ValueError, match=message):
        RayEvaluator(env, **given)


# -- what may happen to a cluster -----------------------------------------------------------------


def last_states(n):
    """A `MakeSummarizers`, as of a search."""
    places = np.arange(n)
    return {"last": lambda rollouts, some: (rollouts.final_observations, places[some])}


@pytest.fixture
def assert_is_right(here, assert_same_rollouts):
    def assert_is_right(there):
        population = make_population(here)
        mine = there.play(population, 0, last_states(POPULATION))
        its = here.evaluate(population, 0)
        assert_same_rollouts(mine, its)
        assert mine.observations is None
        last, places = mine.summaries["last"]
        np.testing.assert_array_equal(last, its.final_observations)
        np.testing.assert_array_equal(places, np.arange(POPULATION))

    return assert_is_right


def test_two_workers_are_killed(tmp_path, nodes, eventful, assert_is_right):
    there = RayEvaluator(eventful(Times(tmp_path, 2, die)), n_workers=2, resources={"node": 1})
    assert_is_right(there)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.nightly
def test_a_node_goes_and_another_comes(nodes, cluster, tmp_path, eventful, assert_is_right):
    def wait_for_it():
        (tmp_path / "now").touch()
        time.sleep(0.5)

    def replace_a_node():
        while not (tmp_path / "now").exists():
            time.sleep(0.05)
        cluster.remove_node(nodes[0], allow_graceful=False)
        for _ in range(2):
            cluster.add_node(**NODE)

    there = RayEvaluator(eventful(wait_for_it), resources={"node": 1})
    replacer = threading.Thread(target=replace_a_node)
    replacer.start()
    assert_is_right(there)
    replacer.join()
    cluster.wait_for_nodes()
    assert_is_right(there)
    assert len(there._shards(POPULATION)) == 6  # two for each of the three that are there now
    cluster.remove_node(cluster.worker_nodes.copy().pop())


def test_an_environment_that_kills_its_process_is_an_error(eventful, monkeypatch):
    monkeypatch.setattr(ray_evaluator, "MAX_RETRIES", 1)

    def die_there():
        if os.getpid() != driver:
            die()

    driver = os.getpid()
    there = RayEvaluator(eventful(die_there), n_workers=1, shard_size=POPULATION, **ON_HEAD)
    with pytest.raises(RuntimeError, match=r"^Ray failed in a generation: .*worker died"):
        there.evaluate(make_population(there), 0)


def test_all_are_gone(
    nodes, cluster, make_there, make_model, make_easy_maze, assert_same_run, tmp_path
):
    there = make_there(num_cpus=1, resources={"node": 1}, timeout=60.0)
    model = make_model(NSES, make_easy_maze(), evaluator=there, verbose=1)
    model.learn(1000).save(tmp_path / "model")
    there.timeout = 1.0
    for node in nodes:
        cluster.remove_node(node, allow_graceful=False)
    with pytest.raises(RuntimeError, match=r"^Ray has ended no shard .* for 1 seconds"):
        model.learn(1000, reset_num_timesteps=False)
    whole = make_model(NSES, make_easy_maze()).learn(1000)
    loaded = NSES.load(tmp_path / "model", make_easy_maze(), evaluator="auto")
    for each in (whole, loaded):
        each.learn(1000, reset_num_timesteps=False)
    assert_same_run(whole, loaded)
