"""The archives of runs side by side."""

import gymnasium as gym
import pytest
from ribs.archives import GridArchive

from curiosity_algos import CMAME, NSES, NSLC, MAPElites
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.experiments import SaveRun, load_progress
from curiosity_algos.experiments.elites import n_elites, qd_score, with_archives
from curiosity_algos.experiments.measures import load_compared
from curiosity_algos.experiments.run import Run
from curiosity_gym import BehaviorWrapper

OFFSET = -20.0
RANGES = [(-1.2, 0.6), (-0.07, 0.07)]
GRID = {"dims": [5, 4], "ranges": RANGES}
POLICY = {"policy_kwargs": {"net_arch": [4]}}


@pytest.fixture(scope="module")
def below_zero(tmp_path_factory):
    """A run with returns below 0, in an archive with an offset: its folder, and its elites."""
    folder = tmp_path_factory.mktemp("run")
    env = gym.make("MountainCarContinuous-v0", max_episode_steps=50)
    env = BehaviorWrapper(env, lambda env, obs, info: obs, gym.spaces.Box(-2.0, 2.0, (2,)))
    archive = SparseGridArchive(solution_dim=17, qd_score_offset=OFFSET, **GRID)
    model = MAPElites(env, seed=0, population_size=8, archive=archive, **POLICY)
    model.learn(1000, SaveRun(folder))
    return folder, model.archive.data()


@pytest.fixture(scope="module")
def runs(make_runs):
    """Of each algorithm two runs; of MAPElites also one on a coarser grid."""
    small = {"n_parents": 2, "k": 3}
    folders = [
        *(make_runs(MAPElites) + make_runs(CMAME) + make_runs(MAPElites, seeds=(0,), n_cells=5)),
        *(make_runs(NSLC, **small) + make_runs(NSES, **small)),
    ]
    return load_compared(folders)


def test_the_score_is_that_of_pyribs(below_zero):
    folder, elites = below_zero
    peer = GridArchive(solution_dim=17, qd_score_offset=OFFSET, **GRID)
    peer.add(elites["solution"], elites["objective"], elites["measures"])
    timesteps, scores = qd_score(Run(folder))
    assert peer.stats.obj_max < 0.0
    assert scores[-1] == pytest.approx(peer.stats.qd_score)
    assert n_elites(Run(folder))[1][-1] == peer.stats.num_elites
    assert timesteps.tolist() == load_progress(folder)["time/total_timesteps"].tolist()


def panels(runs):
    """By archive the labels of its runs; without the environment, which all have."""
    found = with_archives(runs).groupby("archive")["label"]
    return {str(name).split(", ", 1)[1]: sorted(set(labels)) for name, labels in found}


def test_the_same_cells_are_one_archive_and_elites_without_cells_are_each_labels_own(runs):
    coarse, fine = (f"MAPElites, n_cells {n}" for n in (5, 50))
    assert panels(runs) == {
        "SparseGridArchive, dims [50, 50, 50, 50]": ["CMAME", fine],
        "SparseGridArchive, dims [5, 5, 5, 5]": [coarse],
        "UnstructuredArchive of NSLC": ["NSLC"],
    }
    assert panels(runs[runs["label"] != coarse]) == {
        "SparseGridArchive": ["CMAME", fine],
        "UnstructuredArchive of NSLC": ["NSLC"],
    }
    assert with_archives(runs[runs["algorithm"] == "NSES"]).empty
