"""A search on a Ray cluster is the search of a single process, whatever becomes of the cluster."""

import gc
import os
import re
import sys
import threading
import time
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from scripts import run_script
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import AURORA, NSES, CuriosityES, MAPElites, make_evaluator
from curiosity_gym import MazeLayout

pytestmark = pytest.mark.extra("ray")
ray = pytest.importorskip("ray")
# What follows cannot be imported without it: hence the E402.

from ray.cluster_utils import Cluster  # noqa: E402

from curiosity_algos.evaluation import ray as ray_evaluator  # noqa: E402
from curiosity_algos.evaluation.ray import RayEvaluator  # noqa: E402
from curiosity_algos.experiments import RunFolder  # noqa: E402
from curiosity_algos.experiments.run_spec import RunSpec  # noqa: E402
from curiosity_algos.experiments.training import train  # noqa: E402

ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import tests

POPULATION = 12
PATIENT = {"start_timeout": 240.0}
"""Where nothing but the machine is slow."""
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
def evaluator_of(nodes):
    """Makes evaluators on the two nodes, whose workers end with the test."""
    made = []

    def make(env, *args, **given):
        given = {"n_workers": 2, "resources": {"node": 1}, **PATIENT, **given}
        made.append(RayEvaluator(env, *args, **given))
        return made[-1]

    yield make
    for each in made:
        each.close()


@pytest.fixture(scope="module")
def workers(cluster):
    """An evaluator of the tests' maze that many share: its two workers take seconds to start."""
    layout = MazeLayout("corridor", 40, 6, (8, 3), (16, 3), [])
    env = gym.make("CuriosityMaze-v0", layout=layout, horizon=64)
    made = RayEvaluator(env, {"net_arch": [4]}, n_workers=2, **ON_HEAD, **PATIENT)
    yield made
    made.close()


@pytest.fixture
def one_each(monkeypatch):
    """`evaluator="ray"` takes a single worker, where it would have one on each processor."""
    monkeypatch.setattr(RayEvaluator, "_n_wanted", lambda self: self.n_workers or 1)
    yield
    gc.collect()  # a model is part of a circle, and holds its worker until that goes


def make_cartpole():
    return gym.make("CartPole-v1", max_episode_steps=30)


def make_population(evaluator, n=POPULATION):
    rng = np.random.default_rng(0)
    return rng.normal(0, 1, (n, evaluator.n_parameters)).astype(np.float32)


def assert_equal(one, other):
    same = ("returns", "lengths", "success", "terminated", "behaviors", "final_observations")
    for name in (*same, "visited"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


class Eventful:
    """An evaluator of CartPole with which something happens before it plays.

    Args:
        happen: Is told the parameters that are to be played.
    """

    def __init__(self, happen):
        self._evaluator = make_evaluator(make_cartpole, n_threads=1)
        self._happen = happen
        self.n_parameters = self._evaluator.n_parameters

    def evaluate(self, parameters, seed=None):
        self._happen(parameters)
        return self._evaluator.evaluate(parameters, seed)


def eventful(happen):
    return lambda: Eventful(happen)


class Once:
    """Does something the first time that the first policy is played, in whatever process.

    Args:
        folder: Where a file remembers it.
        what: Is done.
    """

    def __init__(self, folder, what):
        self._file = folder / "done"
        self._first = make_population(Eventful(None))[0]
        self._what = what

    def __call__(self, parameters):
        if (parameters[0] == self._first).all():
            try:
                self._file.touch(exist_ok=False)
            except FileExistsError:
                return
            self._what()


def die():
    os._exit(1)


def hang():
    time.sleep(1e6)


def raise_an_error():
    raise ValueError("`env` is out of order.")


class Far(gym.Wrapper):
    """A wrapper of a script."""

    def step(self, action):
        observation, reward, *rest = self.env.step(action)
        return observation, reward + 2.0, *rest


class InPlace(gym.Env):
    """One that writes into an array of its own."""

    observation_space = gym.spaces.Box(-9, 9, (2,))
    action_space = gym.spaces.Box(-1, 1, (2,))

    def __init__(self):
        self.place = np.zeros(2, dtype=np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.place[:] = self.np_random.uniform(-1, 1, 2)
        return self.place.copy(), {}

    def step(self, action):
        self.place += action
        return self.place.copy(), float(self.place[0]), bool((abs(self.place) > 5).any()), False, {}


def make_vec():
    return gym.make_vec("CartPole-v1", 4, vectorization_mode="vector_entry_point")


ENVIRONMENTS = {
    "a wrapper of a script": lambda: Far(make_cartpole()),
    "one that writes into its arrays": lambda: gym.wrappers.TimeLimit(InPlace(), 20),
    "an id that was registered here": "Far-v0",
    "one whose spaces are no vectors": "Blackjack-v1",
    "a vector env with one generator": lambda: make_evaluator(make_vec()),
}


# -- the same bits --------------------------------------------------------------------------------


class TestBits:
    @pytest.mark.parametrize(
        ("algorithm", "changes"),
        [
            (CuriosityES, {}),
            (CuriosityES, {"n_states": None, "bonus": "icm"}),
            (MAPElites, {}),
            (AURORA, {}),
        ],
    )
    def test_of_a_search(
        self, workers, algorithm, changes, make_model, make_easy_maze, assert_same_run
    ):
        there = make_model(algorithm, make_easy_maze(), evaluator=workers, **changes)
        here = make_model(algorithm, make_easy_maze(), **changes)
        for model in (there, here):
            model.learn(1500)
        assert there.generation > 3
        assert 1 <= there.n_workers <= 2
        assert_same_run(there, here)

    def test_of_a_search_whose_bonus_has_a_memory(
        self, workers, make_model, make_easy_maze, assert_same
    ):
        models = [
            make_model(CuriosityES, make_easy_maze(), n_states=None, **given)
            for given in ({"evaluator": workers}, {})
        ]
        for model in models:
            model.learn(1500)
        assert models[0].generation == models[1].generation > 3
        states = [model.get_parameters() for model in models]
        for state in states:  # features of what is remembered are made where they are asked for
            del state["_motivation"]["bonus"]["memory"]["features"]
            del state["_motivation"]["bonus"]["memory"]["is_current"]
        assert_same(*states)

    @pytest.mark.parametrize("shard_size", [None, 1, 5])
    def test_of_whole_trajectories(
        self, shard_size, workers, make_easy_maze, monkeypatch, assert_same_rollouts
    ):
        here, there = make_evaluator(make_easy_maze(), {"net_arch": [4]}), workers
        monkeypatch.setattr(there, "shard_size", shard_size)
        one, other = (each.evaluate(make_population(here), 0) for each in (there, here))
        assert_same_rollouts(one, other)
        one.returns[:] = 0.0  # as of any evaluator

    def test_in_any_order_of_completion(self, evaluator_of):
        rng = np.random.default_rng()
        there = evaluator_of(
            eventful(lambda parameters: time.sleep(rng.uniform(0.0, 0.1))), shard_size=1
        )
        here = make_evaluator(make_cartpole)
        population = make_population(here)
        for seed in range(3):
            assert_equal(there.evaluate(population, seed), here.evaluate(population, seed))

    @pytest.mark.parametrize("first", ["ray", "auto"])
    def test_saved_and_resumed_across_backends(
        self, one_each, cluster, first, make_model, make_easy_maze, assert_same_run, tmp_path
    ):
        whole = make_model(CuriosityES, make_easy_maze()).learn(3000)
        model = make_model(CuriosityES, make_easy_maze(), evaluator=first).learn(1500)
        model.save(tmp_path / "model")
        second = {"ray": "auto", "auto": "ray"}[first]
        loaded = CuriosityES.load(tmp_path / "model", make_easy_maze(), evaluator=second)
        loaded.learn(3000 - loaded.num_timesteps, reset_num_timesteps=False)
        assert (loaded.n_workers is None) == (second == "auto")
        assert (model.n_workers is None) == (first == "auto")
        whole.learn(loaded.num_timesteps - whole.num_timesteps, reset_num_timesteps=False)
        assert_same_run(loaded, whole)

    @pytest.mark.parametrize("kind", ENVIRONMENTS)
    def test_of_any_environment(self, kind, evaluator_of, monkeypatch):
        monkeypatch.setattr(gym.envs.registration, "registry", dict(gym.registry))
        gym.register("Far-v0", entry_point=lambda: Far(make_cartpole()))
        env = ENVIRONMENTS[kind]
        there = evaluator_of(env, n_workers=1)
        here = env() if "generator" in kind else make_evaluator(env)
        population = make_population(here, 11)
        assert_equal(there.evaluate(population, 0), here.evaluate(population, 0))

    def test_a_closed_one_makes_room_and_goes_on(self, evaluator_of):
        population = make_population(make_evaluator(make_cartpole))
        most = {"n_workers": 1, "num_cpus": 0.1, "resources": {"head": 0.6}}
        one, other = (evaluator_of(make_cartpole, **most) for _ in range(2))
        first = one.evaluate(population, 0)
        one.close()
        assert one.n_live == 0
        assert_equal(other.evaluate(population, 0), first)
        other.close()
        assert_equal(one.evaluate(population, 0), first)

    def test_a_run_goes_on_across_backends(self, one_each, cluster, make_easy_maze, tmp_path):
        register = {"id": "Easy-v0", "entry_point": lambda: make_easy_maze().unwrapped}
        gym.register(**register, max_episode_steps=64)
        given = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}
        run = RunSpec("map_elites", "Easy-v0", 0, 2000, settings=given)
        there = replace(run, settings={**run.settings, "evaluator": "ray"}, timesteps=1000)
        train(there, tmp_path / "both")
        train(replace(there, timesteps=1500), tmp_path / "both")
        train(run, tmp_path / "both")
        train(run, tmp_path / "one")
        both, one = (RunFolder(tmp_path / name) for name in ("both", "one"))
        assert both.result()["best_return"] == one.result()["best_return"]
        gym.registry.pop("Easy-v0")

    def test_errors_are_those_of_the_evaluator(self, tmp_path, evaluator_of):
        there = evaluator_of(eventful(Once(tmp_path, raise_an_error)), n_workers=1)
        population = make_population(there)
        with pytest.raises(ValueError, match=r"^`env` is out of order.$"):
            there.evaluate(population, 0)
        here = make_evaluator(make_cartpole)
        assert_equal(there.evaluate(population, 0), here.evaluate(population, 0))

    def test_a_worker_without_its_environment_says_so(self, evaluator_of):
        def make():
            if os.getpid() != driver:
                raise ImportError("No module named 'simulator'")
            return make_evaluator(make_cartpole)

        driver = os.getpid()
        there = evaluator_of(make, n_workers=1)
        message = r"could not make its environment: No module named 'simulator'$"
        with pytest.raises(RuntimeError, match=message):
            there.evaluate(make_population(there), 0)

    def test_a_bonus_that_cannot_be_sent_says_so(self, workers, make_model, make_easy_maze):
        model = make_model(CuriosityES, make_easy_maze(), evaluator=workers, n_states=None)
        model.trained_bonus.lock = threading.Lock()
        with pytest.raises(ValueError, match="`bonus` must be one that can be pickled"):
            model.learn(1)

    def test_progress_shows_workers(self, workers, make_model, make_easy_maze, capsys):
        model = make_model(NSES, make_easy_maze(), evaluator=workers, verbose=1)
        model.learn(300, progress_bar=True)
        shown = capsys.readouterr()
        assert re.search(r"workers=[12]\b", shown.err)
        assert "workers" in shown.out

    def test_where_ray_was_begun_anew(self, evaluator_of, cluster):
        there, here = evaluator_of(make_cartpole, n_workers=1), make_evaluator(make_cartpole)
        population = make_population(here)
        for _ in range(2):
            assert_equal(there.evaluate(population, 0), here.evaluate(population, 0))
            ray.shutdown()
            ray.init(address=cluster.address, log_to_driver=False)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("shard_size", 0.5, "`shard_size` must be a whole number of at least 1"),
        ("num_cpus", 0, "`num_cpus` must be"),
        ("start_timeout", -1, "`start_timeout` must be"),
        ("resources", {"GPU": 1}, "`resources` must be amounts above 0 .* not CPU, GPU"),
        ("resources", {"simulator": "two"}, "`resources` must be amounts above 0"),
    ],
)
def test_errors_name_the_argument(name, value, message):
    with pytest.raises(ValueError, match=message):
        RayEvaluator(make_cartpole, **{name: value})


@pytest.mark.parametrize(
    "make", [make_cartpole, make_vec, lambda: DummyVecEnv([make_cartpole] * 2)]
)
def test_an_environment_that_workers_cannot_make_is_refused(make):
    with pytest.raises(ValueError, match="`env` must be an id or a function that makes the env"):
        RayEvaluator(make())


def test_so_is_a_function_that_cannot_travel():
    lock = threading.Lock()
    with pytest.raises(ValueError, match="`env` must be an id or a function that makes the env"):
        RayEvaluator(lambda: (lock, make_cartpole())[1])


# -- what may happen to a cluster -----------------------------------------------------------------


def last_states(n):
    """A `MakeSummarizers`, as of a search."""
    places = np.arange(n)
    return {"last": lambda rollouts, some: (rollouts.trajectories[0][:, 0], places[some])}


class TestFaults:
    """On two nodes of one processor each, the results are those of one process."""

    def assert_is_right(self, there):
        here = make_evaluator(make_cartpole)
        population = make_population(here)
        for seed in (0, 1):
            mine = there.evaluate_and_summarize(population, seed, last_states(POPULATION))
            its = here.evaluate(population, seed)
            assert_equal(mine, its)
            first, places = mine.summaries["last"]
            np.testing.assert_array_equal(first, its.trajectories[0][:, 0])
            np.testing.assert_array_equal(places, np.arange(POPULATION))

    def test_a_worker_dies(self, tmp_path, evaluator_of):
        self.assert_is_right(evaluator_of(eventful(Once(tmp_path, die))))
        assert (tmp_path / "done").exists()

    def test_a_worker_hangs(self, tmp_path, evaluator_of):
        self.assert_is_right(evaluator_of(eventful(Once(tmp_path, hang)), timeout=5.0))
        assert (tmp_path / "done").exists()

    def test_a_node_goes(self, nodes, cluster, tmp_path, evaluator_of):
        def wait_for_it(parameters):
            (tmp_path / "now").touch()
            time.sleep(1.0)

        def remove():
            while not (tmp_path / "now").exists():
                time.sleep(0.05)
            cluster.remove_node(nodes[0], allow_graceful=False)

        there = evaluator_of(eventful(wait_for_it))
        remover = threading.Thread(target=remove)
        remover.start()
        self.assert_is_right(there)
        remover.join()
        assert there.n_live <= 1

    def test_a_node_comes(self, cluster, evaluator_of):
        there = evaluator_of(make_cartpole, n_workers=None)
        self.assert_is_right(there)
        assert len(there._workers) == 2
        node = cluster.add_node(**NODE)
        cluster.wait_for_nodes()
        self.assert_is_right(there)
        assert len(there._workers) == 3
        cluster.remove_node(node)

    def test_ray_is_shut_down(self, cluster, evaluator_of, monkeypatch):
        """Whoever plays is told, and nothing else is joined or started."""

        def shut_down(evaluator):  # between two waits: within one Ray itself may crash
            ray.shutdown()
            evaluator._check_session()

        there = evaluator_of(make_cartpole, n_workers=1)
        monkeypatch.setattr(RayEvaluator, "_wait", shut_down)
        try:
            with pytest.raises(RuntimeError, match="Ray was shut down in the midst of a gen"):
                there.evaluate(make_population(there), 0)
            assert not ray.is_initialized()
        finally:
            ray.shutdown()
            ray.init(address=cluster.address, log_to_driver=False)

    def test_an_environment_that_kills_its_process_is_an_error(self, evaluator_of, monkeypatch):
        monkeypatch.setattr(ray_evaluator, "MAX_LOSSES", 2)

        def die_there(parameters):
            if os.getpid() != driver:
                die()

        driver = os.getpid()
        there = evaluator_of(eventful(die_there), n_workers=1, shard_size=POPULATION)
        with pytest.raises(RuntimeError, match="policies 0 to 12 were lost 2 times"):
            there.evaluate(make_population(there), 0)

    def test_all_are_gone(
        self, nodes, cluster, make_model, make_easy_maze, assert_same_run, tmp_path, evaluator_of
    ):
        there = evaluator_of(make_easy_maze(), {"net_arch": [4]})
        model = make_model(NSES, make_easy_maze(), evaluator=there).learn(1000)
        model.save(tmp_path / "model")
        there.start_timeout = 3.0
        for node in nodes:
            cluster.remove_node(node, allow_graceful=False)
        with pytest.raises(RuntimeError, match=r"No Ray worker .* needs 1 processors"):
            model.learn(1000, reset_num_timesteps=False)
        whole = make_model(NSES, make_easy_maze()).learn(1000)
        loaded = NSES.load(tmp_path / "model", make_easy_maze(), evaluator="auto")
        for each in (whole, loaded):
            each.learn(1000, reset_num_timesteps=False)
        assert_same_run(whole, loaded)


FULL_STORE = """
import gymnasium as gym
import numpy as np
import ray
from curiosity_algos import make_evaluator
from curiosity_algos.evaluation.ray import RayEvaluator

def make_env():
    return gym.make("CartPole-v1", max_episode_steps=30)

config = {"automatic_object_spilling_enabled": False, "local_fs_capacity_threshold": 0.0}
settings = {"include_dashboard": False, "log_to_driver": False, "_system_config": config}
ray.init("local", num_cpus=1, object_store_memory=80 * 2**20, **settings)
mlp = {"net_arch": [256, 256]}
there, here = RayEvaluator(make_env, mlp, n_workers=1), make_evaluator(make_env, mlp)
parameters = np.random.default_rng(0).normal(0, 1, (1000, there.n_parameters)).astype(np.float32)
try:
    there.evaluate(parameters, 0)
except RuntimeError as error:
    print(error)
same = [each.evaluate(parameters[:2], 0).returns.tolist() for each in (there, here)]
print(same[0] == same[1])
ray.shutdown()
"""


def test_a_full_object_store_is_an_error(tmp_path):
    script = tmp_path / "full_store.py"
    script.write_text(FULL_STORE)
    *error, same = run_script(script, tmp_path).splitlines()
    assert re.search(r"Ray failed (?s:.*)(store|disk)", "\n".join(error))
    assert same == "True"
