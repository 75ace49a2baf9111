"""What every algorithm with an archive does."""

import copy
import re

import gymnasium as gym
import numpy as np
import pytest
from ribs.archives import GridArchive
from ribs.emitters import (
    GaussianEmitter,
    GradientArborescenceEmitter,
    IsoLineEmitter,
)

import curiosity_gym
from curiosity_algos import AURORA, CMAME, NSLC, CuriosityMAPElites, MAPElites
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.archives.verify import behaviors_of
from curiosity_algos.evaluation.mlp import act

WITH_ARCHIVES = [NSLC, MAPElites, CMAME, AURORA, CuriosityMAPElites]
EVERY = pytest.mark.parametrize(
    "algorithm", WITH_ARCHIVES, ids=lambda algorithm: algorithm.__name__
)
"""For what each algorithm does in a way of its own."""


@pytest.fixture(params=[MAPElites, AURORA], ids=lambda algorithm: algorithm.__name__)
def algorithm(request):
    """One with cells and one without, whose measures are learned."""
    return request.param


@EVERY
def test_elites_reproduce(algorithm, make_model, make_easy_maze):
    model = make_model(algorithm, make_easy_maze(horizon=2000)).learn(47 * 2000)
    report = model.archive.verify(make_easy_maze(horizon=2000))
    assert report.share == 1.0
    assert len(model.archive) > 1
    np.testing.assert_array_equal(report.objective, model.archive.data("objective"))


def test_elites_of_random_starts_reproduce_with_their_seeds(algorithm, make_model, make_classic):
    make = lambda: make_classic("Pendulum-v1", max_episode_steps=30)  # noqa: E731
    model = make_model(algorithm, make()).learn(1000)
    assert len(np.unique(model.archive.data("seed"))) > 1
    assert model.archive.verify(make()).share == 1.0


def test_a_niche_acts_with_its_nearest_elite(algorithm, make_model, make_easy_maze):
    env = make_easy_maze()
    model = make_model(algorithm, env).learn(3000)
    observation, _ = env.reset()
    acting = model.policy.vector.copy()
    _, slots = np.unique(behaviors_of(model.archive), axis=0, return_index=True)
    for slot in slots:
        niche = behaviors_of(model.archive)[slot]
        elite = model.archive.data("solution")[slot]
        expected = act(model.policy.mlp, elite[None], observation[None])[0]
        np.testing.assert_array_equal(model.predict(observation, niche=niche)[0], expected)
    np.testing.assert_array_equal(model.policy.vector, acting)


@EVERY
def test_another_maze_starts_anew(algorithm, make_model, make_maze):
    model = make_model(algorithm, make_maze()).learn(6 * 50)
    model.set_env(make_maze())
    assert len(model.archive) > 0
    emitted = model._ask()
    model.set_env(make_maze(layout="snake"))
    assert len(model.archive) == 0
    assert not np.array_equal(model._ask(), emitted)
    model.learn(6 * 50)
    assert model.archive.verify(make_maze(layout="snake")).share == 1.0


def test_a_failed_generation_can_be_taken_again(algorithm, make_model, make_easy_maze):
    model = make_model(algorithm, make_easy_maze())
    evaluate = model.evaluator.evaluate

    def fail(parameters, seed):
        raise OSError("the simulator is gone")

    model.evaluator.evaluate = fail
    with pytest.raises(OSError, match="gone"):
        model.learn(1)
    model.evaluator.evaluate = evaluate
    assert len(model.learn(2000).archive) > 0


@pytest.mark.parametrize(
    ("algorithm", "what"),
    [(MAPElites, "behaviors")]
    + [(each, "observations") for each in (NSLC, AURORA, CuriosityMAPElites)],
)
def test_what_is_not_finite_enters_no_archive(algorithm, make_model, make_easy_maze, what):
    model = make_model(algorithm, make_easy_maze())
    evaluate = model.evaluator.evaluate

    def spoil(parameters, seed):
        rollouts = evaluate(parameters, seed)
        for name in ("observations", "final_observations") if what == "observations" else [what]:
            getattr(rollouts, name)[1] = np.inf
        return rollouts

    model.evaluator.evaluate = spoil
    with pytest.raises(ValueError, match="`env` must give finite"):
        model.learn(1)
    assert len(model.archive) == model.generation == 0


@pytest.mark.parametrize("algorithm", [MAPElites])
def test_an_env_without_behaviors_leaves_the_old_one(algorithm, make_model, make_classic):
    plain, behaving = gym.make("Pendulum-v1"), make_classic("Pendulum-v1")
    model = make_model(algorithm, behaving).learn(1200)
    n_elites, env = len(model.archive), model.get_env()
    with pytest.raises(ValueError, match="`env` must have a bounded `behavior_space`"):
        model.set_env(plain)
    assert model.get_env() is env
    assert len(model.archive) == n_elites


def iso_line(archive, x0, seed):
    return [IsoLineEmitter(archive, x0=x0, iso_sigma=0.1, batch_size=9, seed=seed)]


def gaussian(archive, x0, seed):
    """MAP-Elites' own."""
    return [GaussianEmitter(archive, sigma=0.3, x0=x0, batch_size=6, seed=seed)]


def mixed(archive, x0, seed):
    return iso_line(archive, x0, seed) + gaussian(archive, x0, seed + 1)


class TestEmitters:
    def test_the_algorithms_own_make_its_own_run(self, make_model, make_easy_maze, assert_same_run):
        plain = make_model(MAPElites, make_easy_maze()).learn(2000)
        given = make_model(MAPElites, make_easy_maze(), emitters=gaussian).learn(2000)
        assert_same_run(plain, given)

    def test_theirs_are_the_policies(self, algorithm, make_model, make_easy_maze):
        sizes, mutants = [], []

        class Spy(GaussianEmitter):
            def ask(self):
                mutants.append(super().ask())
                return mutants[-1]

        def spies(archive, x0, seed):
            return [Spy(archive, sigma=0.2, x0=x0, batch_size=n, seed=seed + n) for n in (4, 7)]

        model = make_model(algorithm, make_easy_maze(), emitters=spies, population_size=11)
        model.learn(2000, callback=lambda found, _: sizes.append(len(found["rollouts"])) is None)
        assert model.population_size == 11
        assert {*sizes} == {11}
        emitted = {row.tobytes() for row in np.concatenate(mutants).astype(np.float32)}
        elites = {row.tobytes() for row in model.archive.data("solution")}
        assert len(elites) > 1
        assert elites <= emitted
        assert model.archive.verify(make_easy_maze()).share == 1.0

    @pytest.mark.parametrize("few", [NSLC, CMAME])
    def test_they_may_be_fewer_than_the_algorithms_own(self, few, make_easy_maze, tmp_path):
        def one(archive, x0, seed):
            return [GaussianEmitter(archive, sigma=0.2, x0=x0, batch_size=1, seed=seed)]

        model = few(make_easy_maze(), emitters=one, seed=0, device="cpu").learn(200)
        model.save(tmp_path / "few")
        loaded = few.load(tmp_path / "few", env=make_easy_maze(), emitters=one)
        assert loaded.population_size == 1

    @pytest.mark.parametrize(
        ("algorithm", "emitters"),
        [(MAPElites, mixed), (AURORA, iso_line)],
    )
    def test_a_loaded_model_goes_on(
        self, algorithm, make_model, make_easy_maze, assert_resumes, emitters
    ):
        model = make_model(algorithm, make_easy_maze(), emitters=emitters, population_size=56)
        assert_resumes(model.learn(3000), make_easy_maze(), timesteps=3000, emitters=emitters)

    @pytest.mark.parametrize(
        "made",
        [
            3,
            lambda *args: gaussian(*args)[0],
            lambda *args: [],
            lambda *args: gaussian(*args) * 2,
            lambda archive, *args: gaussian(copy.copy(archive), *args),
            lambda *args: [vars(emitter).update(odd=[1]) or emitter for emitter in gaussian(*args)],
            lambda archive, x0, seed: [
                GradientArborescenceEmitter(
                    archive, x0=x0, sigma0=0.1, lr=0.1, batch_size=5, seed=seed
                )
            ],
        ],
    )
    def test_they_must_be_a_list_of_emitters_on_the_archive(self, make_model, make_maze, made):
        said = r"(?i)emitters?` must|one emitter|unique|odd is a list, which no state can hold"
        with pytest.raises((TypeError, ValueError), match=said):
            make_model(MAPElites, make_maze(), emitters=made)

    def test_they_say_how_many(self, make_model, make_maze):
        with pytest.raises(ValueError, match=r"^`population_size` must be the 9 .* got 20"):
            make_model(MAPElites, make_maze(), emitters=iso_line, population_size=20)


def make_grid(space, n_parameters, n_cells=50, **changes):
    ranges = list(zip(space.low.tolist(), space.high.tolist(), strict=True))
    settings = {"dims": [n_cells] * len(ranges), "ranges": ranges, "solution_dtype": np.float32}
    return SparseGridArchive(solution_dim=n_parameters, **(settings | changes))


def make_own(algorithm, make_model, make_maze, **changes):
    """An archive that fits a small model of the algorithm."""
    model = make_model(algorithm, make_maze())
    sizes = {"solution_dim": model.policy.mlp.n_parameters, "solution_dtype": np.float32}
    if isinstance(model.archive, SparseGridArchive):
        return make_grid(model._behavior_space, sizes["solution_dim"], **changes)
    settings = sizes | model.archive.settings | changes
    return UnstructuredArchive(**settings)


def pendulum(n_behaviors, bound=8.0):
    """Short episodes, whose behavior is the beginning of the final observation."""
    return curiosity_gym.BehaviorWrapper(
        gym.make("Pendulum-v1", max_episode_steps=20),
        lambda env, observation, info: observation[:n_behaviors],
        gym.spaces.Box(-bound, bound, (n_behaviors,)),
    )


class TestArchive:
    @EVERY
    def test_one_like_the_algorithms_makes_its_run(
        self, algorithm, make_model, make_easy_maze, assert_same_run
    ):
        own = make_own(algorithm, make_model, make_easy_maze)
        plain = make_model(algorithm, make_easy_maze()).learn(3000)
        given = make_model(algorithm, make_easy_maze(), archive=own).learn(3000)
        assert given.archive is own
        assert_same_run(plain, given)
        assert own.verify(make_easy_maze()).share == 1.0

    def test_a_grid_algorithm_takes_one_without_cells(self, make_model, make_easy_maze):
        n_parameters = make_model(MAPElites, make_easy_maze()).policy.mlp.n_parameters
        own = UnstructuredArchive(
            solution_dim=n_parameters, measure_dim=4, target_size=9, k_neighbors=1
        )
        model = make_model(MAPElites, make_easy_maze(), archive=own).learn(3000)
        assert 1 < len(model.archive) <= 9
        assert own.verify(make_easy_maze()).share == 1.0

    def test_its_ranges_need_no_bounded_behaviors(self, make_model):
        env = pendulum(1, bound=np.inf)
        own = SparseGridArchive(solution_dim=21, dims=[9], ranges=[(-1.0, 1.0)])
        model = make_model(MAPElites, env, archive=own).learn(500)
        assert len(model.archive) > 1

    def test_a_search_begins_with_its_elites(self, make_model, make_easy_maze, tmp_path):
        make_model(MAPElites, make_easy_maze()).learn(3000).archive.save(tmp_path / "elites")
        own = SparseGridArchive.load(tmp_path / "elites")
        n_elites, solutions = len(own), own.data("solution")
        model = make_model(MAPElites, make_easy_maze(), archive=own, seed=9)
        np.testing.assert_array_equal(model._center(), own.best_elite["solution"])
        model._emitters.emitters[0]._sigma = np.float32(0.0)
        assert {row.tobytes() for row in model._ask()} <= {row.tobytes() for row in solutions}
        assert len(model.learn(2000).archive) >= n_elites

    def test_its_draws_follow_the_seed(self, make_model, make_easy_maze, assert_same_run):
        runs = []
        for seed in (1, 2):
            own = make_own(MAPElites, make_model, make_easy_maze, seed=seed)
            runs.append(make_model(MAPElites, make_easy_maze(), archive=own).learn(2000))
        assert_same_run(*runs)

    def test_a_loaded_model_goes_on(self, algorithm, make_model, make_easy_maze, assert_resumes):
        own, other = (make_own(algorithm, make_model, make_easy_maze) for _ in range(2))
        model = make_model(algorithm, make_easy_maze(), archive=own).learn(2000)
        loaded = assert_resumes(model, make_easy_maze(), timesteps=2000, archive=other)
        assert loaded.archive is other

    @pytest.mark.parametrize("changes", [{"threshold": 0.5}, {"net_arch": [4]}])
    def test_load_takes_one_that_has_lived(self, make_model, make_maze, tmp_path, changes):
        own, other = (make_own(NSLC, make_model, make_maze, **each) for each in ({}, changes))
        model = make_model(NSLC, make_maze(), archive=own).learn(1)
        model.save(tmp_path / "model")
        loaded = NSLC.load(tmp_path / "model", archive=other)
        assert loaded.archive.threshold == model.archive.threshold

    @pytest.mark.parametrize("changes", [{"dims": [5] * 4}, {"qd_score_offset": -3.0}, None])
    def test_load_takes_one_of_the_same_settings(self, changes, make_model, make_maze, tmp_path):
        own = make_own(MAPElites, make_model, make_maze)
        make_model(MAPElites, make_maze(), archive=own).learn(1).save(tmp_path / "model")
        given = {}
        if changes is not None:
            given = {"archive": make_own(MAPElites, make_model, make_maze, **changes)}
        with pytest.raises(ValueError, match=r"^`archive` must be given to `load` as to the"):
            MAPElites.load(tmp_path / "model", **given)

    @pytest.mark.parametrize(
        ("algorithm", "kind", "wanted"),
        [
            (NSLC, SparseGridArchive, "Unstructured"),
            (AURORA, SparseGridArchive, "Unstructured"),
            (MAPElites, GridArchive, "Elite"),
        ],
    )
    def test_it_is_of_this_package_and_of_some_algorithms_without_cells(
        self, algorithm, kind, wanted, make_model, make_maze
    ):
        own = kind(solution_dim=5, dims=[2], ranges=[(0.0, 1.0)])
        with pytest.raises(ValueError, match=f"^`archive` must be of the class {wanted}Archive"):
            make_model(algorithm, make_maze(), archive=own)

    def test_it_must_fit(self, make_model, make_maze):
        four = {"dims": [2] * 4, "ranges": [(0.0, 1.0)] * 4}
        n = make_model(MAPElites, make_maze()).policy.mlp.n_parameters
        full = SparseGridArchive(solution_dim=n, **four)
        full.add(np.zeros((1, n)), [1.0], np.zeros((1, 4)))
        flat = SparseGridArchive(solution_dim=n, dims=[2], ranges=[(0, 1)])
        noted = SparseGridArchive(solution_dim=n, **four, extra_fields={"note": ((), float)})
        for message, own in [
            ("hold policies of", SparseGridArchive(solution_dim=n + 1, **four)),
            ("have a `measure_dim` of 4", flat),
            ("keep the extra fields seed int64 ()", noted),
            ("keep the extra fields seed int64 ()", full),
        ]:
            before = own.field_list
            with pytest.raises(ValueError, match=f"^`archive` must {re.escape(message)}"):
                make_model(MAPElites, make_maze(), archive=own)
            assert (own.field_list, own.net_arch) == (before, None)

    def test_an_env_of_other_behaviors_leaves_it(self, make_model):
        one = pendulum(2)
        own = SparseGridArchive(solution_dim=21, dims=[3, 3], ranges=[(-1.0, 1.0)] * 2)
        model = make_model(MAPElites, one, archive=own).learn(100)
        n_elites = len(own)
        with pytest.raises(
            ValueError, match=r"^`archive` must have a `measure_dim` of 3, .* got 2"
        ):
            model.set_env(pendulum(3))
        assert len(own) == n_elites > 0
