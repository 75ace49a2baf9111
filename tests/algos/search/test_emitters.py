import numpy as np
import pytest
from ribs.emitters import GaussianEmitter

from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.search.emitters import ParetoEmitter, TournamentEmitter

N_PARAMETERS = 3
TINY = 1e-9


def make_grid(n=40, dtype=np.float64):
    """n elites: the first parameter is the cell, 0 to n - 1, the objective something else."""
    archive = SparseGridArchive(
        solution_dim=N_PARAMETERS, dims=[40], ranges=[(0, 40)], solution_dtype=dtype, seed=3
    )
    cells = np.arange(n)
    solution = np.repeat(cells[:, None], N_PARAMETERS, axis=1)
    archive.add(solution, np.sin(cells), cells[:, None] + 0.5)
    return archive


def by_objective(elites):
    return elites["objective"]


def make_tournament(archive=None, *, tournament_size=4, score=by_objective, **changes):
    return TournamentEmitter(
        make_grid() if archive is None else archive,
        score=score,
        tournament_size=tournament_size,
        **({"sigma": TINY, "x0": np.full(N_PARAMETERS, 5.0), "batch_size": 30} | changes),
        seed=1,
    )


class TestTournament:
    @pytest.mark.parametrize("tournament_size", [1, 2, 7])
    def test_parents_win_their_tournaments(self, tournament_size):
        parents = np.round(make_tournament(tournament_size=tournament_size).ask()[:, 0])
        drawn = make_grid().sample_elites(30 * tournament_size)["solution"][:, 0]
        winners = [
            max(drawn[begin : begin + tournament_size], key=np.sin)
            for begin in range(0, len(drawn), tournament_size)
        ]
        assert parents.tolist() == winners

    @pytest.mark.parametrize(("n", "dtype"), [(0, np.float64), (40, np.float32)])
    def test_tournaments_of_one_are_map_elites(self, n, dtype):
        settings = {"sigma": 0.3, "x0": np.ones(N_PARAMETERS), "batch_size": 9, "seed": 1}
        plain = GaussianEmitter(make_grid(n, dtype), **settings)
        emitter = TournamentEmitter(
            make_grid(n, dtype), score=by_objective, tournament_size=1, **settings
        )
        for _ in range(3):
            one, other = plain.ask(), emitter.ask()
            assert one.dtype == other.dtype == dtype
            np.testing.assert_array_equal(one, other)

    def test_few_candidates_are_copied_at_once(self):
        sizes = []

        def score(elites):
            sizes.append(len(elites["objective"]))
            return elites["objective"]

        parents = np.round(make_tournament(score=score, batch_size=150).ask()[:, 0])
        assert sizes == [4 * 64, 4 * 64, 4 * 22]
        drawn = make_grid().sample_elites(4 * 150)["solution"][:, 0].reshape(150, 4)
        assert parents.tolist() == [max(row, key=np.sin) for row in drawn]

    def test_offspring_are_of_x0_while_there_are_no_elites(self):
        asked = make_tournament(make_grid(0), score=None).ask()
        np.testing.assert_allclose(asked, np.full((30, N_PARAMETERS), 5.0), rtol=1e-6)


def make_pareto(**changes):
    archive = UnstructuredArchive(
        solution_dim=N_PARAMETERS, measure_dim=2, target_size=30, k_neighbors=3, seed=0
    )
    settings = {"sigma": TINY, "n_parents": 4, "batch_size": 10, "seed": 1}
    return ParetoEmitter(archive, x0=np.full(N_PARAMETERS, -1.0), **(settings | changes))


def tell(emitter, novelty, competition):
    """A generation whose i-th individual has nothing but i as parameters."""
    n = len(novelty)
    info = {"novelty": np.array(novelty), "local_competition": np.array(competition)}
    solution = np.repeat(np.arange(float(n))[:, None], N_PARAMETERS, axis=1)
    emitter.tell(solution, np.zeros(n), np.zeros((n, 2)), info)


def parents_of(asked):
    parents = np.round(asked[:, 0]).astype(int)
    np.testing.assert_allclose(asked, np.repeat(parents[:, None], N_PARAMETERS, axis=1), atol=1e-6)
    return parents.tolist()


class TestPareto:
    def test_the_first_offspring_are_of_x0(self):
        np.testing.assert_allclose(make_pareto().ask(), np.full((10, 3), -1.0), rtol=1e-6)

    def test_parents_by_hand(self):
        emitter = make_pareto(n_parents=3, batch_size=7)
        # The line 1, 3, 4, 6 dominates; 3 is its most crowded.
        tell(emitter, [0.0, 1.0, 2.0, 2.5, 4.0, 0.5, 9.0], [0, 7, 1, 6, 5, 6, 1])
        assert parents_of(emitter.ask()) == [1, 6, 4, 1, 6, 4, 1]

    def test_the_last_generation_alone_has_offspring(self):
        emitter = make_pareto(n_parents=2)
        tell(emitter, np.full(20, 9.0), np.full(20, 9))
        tell(emitter, np.arange(6.0), np.arange(6))
        assert set(parents_of(emitter.ask())) == {4, 5}

    def test_noise_has_the_deviation_asked_for(self):
        emitter = make_pareto(sigma=0.3, batch_size=3000, n_parents=1)
        tell(emitter, [0.0, 1.0], [0, 1])
        noise = emitter.ask() - 1.0
        assert noise.std(axis=0) == pytest.approx([0.3] * 3, rel=0.06)
        assert np.abs(noise.mean(axis=0)).max() < 0.03
        assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.1
