"""pyribs' own archives in our algorithms: bare pyribs, and our grid, are the oracles."""

import copy

import numpy as np
import pytest
from ribs.archives import CategoricalArchive, CVTArchive, GridArchive, ProximityArchive
from ribs.emitters import GaussianEmitter
from ribs.schedulers import Scheduler

from curiosity_algos import AURORA, CMAME, NSLC, CuriosityMAPElites, MAPElites
from curiosity_algos.archives.pyribs import PyribsPart
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.verify import verify

BOUNDS = [(0.0, 20.0), (0.0, 20.0), (-2.0, 2.0), (-2.0, 2.0)]
CENTROIDS = np.random.default_rng(0).uniform(*np.transpose(BOUNDS), (40, 4))


def grid(n, kind=GridArchive, **changes):
    return kind(solution_dim=n, **({"dims": [6, 6, 2, 2], "ranges": BOUNDS} | changes))


def cvt(n, **changes):
    return CVTArchive(solution_dim=n, **({"centroids": CENTROIDS, "ranges": BOUNDS} | changes))


def soft(n, **changes):
    return grid(n, **({"learning_rate": 0.5, "threshold_min": -1.0} | changes))


KINDS = [grid, cvt, soft]
ALGORITHMS = [MAPElites, CMAME, CuriosityMAPElites]
EVERY_KIND = pytest.mark.parametrize("make", KINDS, ids=lambda make: make.__name__)
EVERY = pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda each: each.__name__)


@pytest.fixture
def n(make_model, make_easy_maze):
    """Parameters of a small policy for the maze."""
    return make_model(MAPElites, make_easy_maze()).policy.mlp.n_parameters


def state(archive):
    return PyribsPart(archive).state_dict()


@EVERY
def test_a_grid_of_theirs_makes_the_run_of_ours(
    algorithm, make_model, make_easy_maze, assert_same, n
):
    archives = [
        grid(n, kind, solution_dtype=np.float32) for kind in (GridArchive, SparseGridArchive)
    ]
    theirs, ours = (
        make_model(algorithm, make_easy_maze(), archive=archive).learn(4000) for archive in archives
    )
    assert theirs.archive is archives[0]
    assert len(theirs.archive) > 5
    for name, expected in ours.archive.data().items():
        np.testing.assert_array_equal(theirs.archive.data(name), expected, err_msg=name)
    assert theirs.archive.stats == ours.archive.stats
    assert_same(theirs.history.state_dict(), ours.history.state_dict())
    np.testing.assert_array_equal(theirs.policy.vector, ours.policy.vector)


@EVERY_KIND
def test_a_run_is_that_of_pyribs_alone(make, make_model, make_easy_maze, n, assert_same):
    def gaussian(archive, x0, seed):
        return [GaussianEmitter(archive, x0=x0, sigma=0.3, batch_size=6, seed=seed)]

    begun = []

    def remembered(archive, x0, seed):
        begun.append((copy.deepcopy(archive), x0, seed))
        return gaussian(archive, x0, seed)

    model = make_model(MAPElites, make_easy_maze(), archive=make(n), emitters=remembered)
    archive, x0, seed = begun[0]
    scheduler = Scheduler(archive, gaussian(archive, x0, seed))
    model.learn(3000)
    for _ in range(len(model.history)):
        rollouts = model.evaluator.evaluate(scheduler.ask().astype(np.float32))
        scheduler.tell(rollouts.returns, rollouts.behaviors, seed=np.zeros(6))
    assert len(archive) > 5
    found, expected = model.archive.data(), archive.data()
    for name in found.keys() - {"seed"}:
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
    assert model.archive.stats == archive.stats
    assert_same(state(model.archive)["rng"], state(archive)["rng"])


@EVERY_KIND
@EVERY
def test_a_loaded_model_goes_on(
    algorithm, make, make_model, make_easy_maze, assert_resumes, assert_same, n
):
    one = make_model(algorithm, make_easy_maze(), archive=make(n)).learn(2000)
    own = make(n, seed=9)
    other = assert_resumes(one, make_easy_maze(), timesteps=2000, archive=own)
    assert other.archive is own
    assert own.stats == one.archive.stats
    assert_same(own.best_elite, one.archive.best_elite)
    assert verify(own, make_easy_maze(), net_arch=[4]).share == 1.0


@EVERY_KIND
def test_its_draws_follow_the_seed(make, make_model, make_easy_maze, assert_same_run, n):
    models = [
        make_model(MAPElites, make_easy_maze(), archive=make(n, seed=seed)).learn(2000)
        for seed in (1, 2)
    ]
    assert_same_run(*models)
    for model in models:
        model.set_random_seed(5)
        model.learn(1000, reset_num_timesteps=False)
    assert_same_run(*models)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_verify_compares_what_is_kept(make_model, make_easy_maze, dtype, n):
    own = grid(n, dtype=dtype)
    make_model(MAPElites, make_easy_maze(), archive=own).learn(3000)
    found = verify(own, make_easy_maze(), net_arch=[4])
    assert found.share == 1.0
    assert found.behaviors.dtype == dtype
    elite = own.data()
    index = elite.pop("index")[:1]
    own._store.add(index, {name: values[:1] for name, values in elite.items()} | {"objective": [7]})
    assert verify(own, make_easy_maze(), net_arch=[4]).failed.tolist() == [0]


def test_predict_finds_the_nearest(make_model, make_easy_maze, n):
    model = make_model(MAPElites, make_easy_maze(), archive=cvt(n)).learn(3000)
    elites = model.archive.data()
    model.policy.vector[:] = 0.0
    for i in (0, len(elites["index"]) - 1):
        assert PyribsPart(model.archive).nearest(elites["measures"][i]) == pytest.approx(
            elites["solution"][i], abs=0.0
        )
    observation = make_easy_maze().reset(seed=0)[0]
    action = model.predict(observation, niche=elites["measures"][0])[0]
    model.policy.vector[:] = elites["solution"][0]
    np.testing.assert_array_equal(action, model.predict(observation)[0])


@EVERY_KIND
def test_another_maze_starts_anew(make, make_model, make_maze, n):
    own = make(n)
    model = make_model(MAPElites, make_maze(), archive=own).learn(6 * 50)
    assert len(own) > 0
    model.set_env(make_maze(layout="snake"))
    assert model.archive is own
    assert len(own) == 0
    model.learn(6 * 50)
    assert verify(own, make_maze(layout="snake"), net_arch=[4]).share == 1.0


@pytest.mark.parametrize(
    ("make", "changes"),
    [
        (grid, {"dims": [5, 6, 2, 2]}),
        (grid, {"qd_score_offset": -3.0}),
        (cvt, {"centroids": CENTROIDS[:-1]}),
    ],
)
def test_load_takes_one_of_the_same_settings(
    make, changes, make_model, make_easy_maze, tmp_path, n
):
    model = make_model(MAPElites, make_easy_maze(), archive=make(n)).learn(2000)
    model.save(tmp_path / "model")
    for other in ({"archive": make(n, **changes)}, {}):
        with pytest.raises(ValueError, match=r"^`archive` must be given to `load` as to the"):
            MAPElites.load(tmp_path / "model", **other)


def test_it_must_fit(make_model, make_easy_maze, n):
    for message, archive in [
        ("hold policies of", grid(n + 1)),
        ("hold policies of", grid((2, 3))),
        ("have a `measure_dim` of 4", grid(n, dims=[2], ranges=[(0, 1)])),
        (r"keep the extra fields seed int64 \(\)", grid(n, extra_fields={"note": ((), float)})),
    ]:
        fields = archive.field_list
        with pytest.raises(ValueError, match=f"^`archive` must {message}"):
            make_model(MAPElites, make_easy_maze(), archive=archive)
        assert archive.field_list == fields
    full = grid(n)
    full.add_single(np.zeros(n), 1.0, np.zeros(4))
    with pytest.raises(ValueError, match=r"^`archive` must keep the extra fields seed"):
        make_model(MAPElites, make_easy_maze(), archive=full)


@pytest.mark.parametrize(
    "archive",
    [
        ProximityArchive(solution_dim=5, measure_dim=4, k_neighbors=1, novelty_threshold=0.1),
        CategoricalArchive(solution_dim=5, categories=[["a"]] * 4),
    ],
    ids=lambda archive: type(archive).__name__,
)
def test_others_are_refused(make_model, make_easy_maze, archive):
    message = "^`archive` must be of the class EliteArchive or GridArchive or CVTArchive, got "
    with pytest.raises(ValueError, match=message + type(archive).__name__):
        make_model(MAPElites, make_easy_maze(), archive=archive)


@pytest.mark.parametrize("algorithm", [NSLC, AURORA])
def test_of_some_algorithms_it_has_no_cells(algorithm, make_model, make_easy_maze, n):
    with pytest.raises(ValueError, match=r"^`archive` must be of the class UnstructuredArchive"):
        make_model(algorithm, make_easy_maze(), archive=grid(n))


@pytest.mark.filterwarnings("ignore:`archive` was empty")
def test_thresholds_that_none_reaches_keep_nothing(make_model, make_easy_maze, n):
    model = make_model(MAPElites, make_easy_maze(), archive=soft(n, threshold_min=1e9))
    model.learn(500)
    assert len(model.archive) == 0
    assert np.isnan(model.history["best"]).all()
    assert np.isfinite(model.policy.vector).all()
