"""The paper's figures and claims come from committed data, and that from runs."""

import re
import shutil
from pathlib import Path
from types import SimpleNamespace

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from benchmarks import claims, judging, paper, paper_tables, prose, reasons, run_numbers
from benchmarks.claims import CLAIMS
from benchmarks.plan import BUDGETS, MAZES, Plan, Series, series_of
from benchmarks.reproduce import TrainedRuns
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.experiments import statistics
from curiosity_algos.experiments.loading import load_final_states
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.sweep import sweep

pytestmark = pytest.mark.nightly
US = MAZES[1]


@pytest.fixture(scope="module")
def plan(tmp_path_factory):
    """Runs of figures 4 and 8, as short as they may be, and one whose behavior is another."""
    folder = tmp_path_factory.mktemp("runs")
    plan = Plan(folder, BUDGETS["smoke"], "paper", (0, 1))
    others = [Series("NSES", {"behavior": "state"}), Series("NSES", {"step": "canonical"})]
    runs = [*plan.runs(4), *plan.runs(8), *(plan.run(series, US, 0) for series in others)]
    sweep(list({run.folder(folder): run for run in runs}.values()), folder, jobs=1)
    return plan


@pytest.fixture(scope="module")
def collected(plan, tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    paper.collect(plan.folder, out=out)
    return out


def test_curves_are_those_of_the_runs(plan, collected):
    runs, tables = TrainedRuns(plan), paper.Tables("paper", collected)
    for measure in ("best_return", "generation_return", "coverage"):
        for (x, y), (steps, values) in zip(
            tables.curves(Series("NSES"), US, measure),
            runs.curves(Series("NSES"), US, measure),
            strict=True,
        ):
            has_begun = x >= steps[0]  # before, there was no reward in these tasks
            last = np.searchsorted(steps, x[has_begun], side="right") - 1
            assert not y[~has_begun].any()
            if measure != "generation_return":
                np.testing.assert_allclose(y[has_begun], values[last], rtol=1e-4, atol=1e-6)
            assert x[-1] == steps[-1]
    assert tables.curves(Series("TD3ICM"), US, "coverage") == []
    of_states = tables.curves(Series("NSES", {"behavior": "state"}), US, "coverage")
    assert len(of_states) == 1


def test_runs_of_a_variant_count_instead_of_the_algorithms_own(plan, collected):
    """In all its mazes: its runs have one step or the other."""
    ours, theirs = (paper.Tables(name, collected) for name in ("paper", "public"))
    step = Series("NSES", {"step": "canonical"})
    for measure in ("best_return", "coverage"):
        ((x, y),) = theirs.curves(Series("NSES"), US, measure)
        np.testing.assert_array_equal((x, y), *ours.curves(step, US, measure))
        np.testing.assert_array_equal(
            theirs.curves(Series("CMAME"), US, measure), ours.curves(Series("CMAME"), US, measure)
        )
    assert len(ours.curves(Series("NSES"), US, "coverage")) == 2
    assert theirs.curves(step, US, "coverage") == []
    for env in (MAZES[0], MAZES[2]):
        assert ours.curves(Series("NSES"), env, "coverage")
        assert theirs.curves(Series("NSES"), env, "coverage") == []
    counts = theirs.final_states(Series("NSES"), US)
    np.testing.assert_array_equal(counts, ours.final_states(step, US))
    of_states = Series("NSES", {"behavior": "state"})
    assert ours.curves(of_states, US, "coverage")
    assert theirs.curves(of_states, US, "coverage") == []  # which has the other step


def test_between_two_times_the_mean_of_generations_counts(monkeypatch):
    steps = np.arange(0.0, 1001.0)
    spike = np.zeros(1001)
    spike[503] = 0.7
    both = dict.fromkeys(["generation_return", "best_return"], lambda run: (steps, spike))
    monkeypatch.setattr(paper, "MEASURES", both)
    hundreds = steps[100::100]
    monkeypatch.setattr(paper, "logged", lambda run, column: (hundreds, 1.0 - hundreds / 1e3))
    table = paper._curves(SimpleNamespace(progress=[paper.BONUS]))
    assert len(table) == paper.N_POINTS
    assert table["generation_return"].max() == pytest.approx(0.07)  # of ten generations
    assert table["timesteps"][table["generation_return"].argmax()] == 510
    assert table["best_return"].max() == 0.0  # which is the last, not the highest
    assert table["bonus"][:9].isna().all()  # before the first log
    assert table["bonus"].iloc[[9, 18, 19, -1]].tolist() == pytest.approx([0.9, 0.9, 0.8, 0.0])


def test_every_final_state_is_in_its_square(plan, collected):
    runs, tables = TrainedRuns(plan), paper.Tables("paper", collected)
    for env, panel in series_of(4).items():
        for series in panel:
            counts = tables.final_states(series, env)
            np.testing.assert_array_equal(counts, runs.final_states(series, env))
            folders = [plan.run(series, env, seed).folder(plan.folder) for seed in plan.seeds]
            ends = np.concatenate([load_final_states(run)["behavior"] for run in folders])
            assert counts.sum() == len(ends)
            x, y = (ends[-1, :2] // 2).astype(int)
            assert counts[y, x] >= 1


def test_the_projection_is_that_of_the_runs(plan, collected):
    ((env, panel),) = series_of(8).items()
    of_runs = TrainedRuns(plan).projection(panel, env)
    projection = paper.Tables("paper", collected).projection(panel, env)
    assert projection.algorithms == of_runs.algorithms
    np.testing.assert_allclose(projection.shares, of_runs.shares, rtol=1e-4)
    for i in range(len(panel)):
        ours, theirs = (each.returns[each.owners == i] for each in (projection, of_runs))
        np.testing.assert_allclose(np.sort(ours), np.sort(theirs), atol=1e-4)


def test_what_is_collected_again_replaces_what_was_there(plan, collected, tmp_path):
    names = ["curves", "final_states", "projection", "runs"]
    assert sorted(path.stem for path in collected.iterdir()) == names
    before = {path: path.read_bytes() for path in collected.iterdir()}
    paper.collect(plan.folder, out=collected)
    assert {path: path.read_bytes() for path in collected.iterdir()} == before


def test_runs_of_other_folders_are_added(plan, collected, tmp_path):
    run = RunSpec("NSLC", MAZES[2], 3, 1e5, {"horizon": 50}, {"n_threads": 1, "preset": "tuned"})
    sweep([run], tmp_path / "more", jobs=1)
    out = tmp_path / "out"
    shutil.copytree(collected, out)
    paper.collect(tmp_path / "more", out=out)
    for name in ("runs", "curves"):
        before, after = (paper.read(each / f"{name}.csv") for each in (collected, out))
        is_new = after["preset"] == "tuned"
        assert set(after.loc[is_new, "algorithm"]) == {"NSLC"}
        kept = after[~is_new].reset_index(drop=True)
        pd.testing.assert_frame_equal(kept, before, check_dtype=False)
    for name in ("final_states", "projection"):  # which have nothing of it
        assert (out / f"{name}.csv").read_bytes() == (collected / f"{name}.csv").read_bytes()


def test_an_unfinished_run_is_left_out(tmp_path):
    run = RunSpec("NSES", US, 0, 1e5, {"horizon": 50}, {"n_threads": 1})
    sweep([run], tmp_path, jobs=1)
    (result,) = tmp_path.rglob("result.json")
    text = result.read_text()
    assert '"total_timesteps": 100000' in text
    result.write_text(text.replace('"total_timesteps": 100000', '"total_timesteps": 200000'))
    with pytest.raises(ValueError, match="`runs` must hold finished runs"):
        paper.collect(tmp_path, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_committed_data_draws_every_figure_light_and_dark(tmp_path, monkeypatch):
    def save_a_sketch(figure, path):
        figure.set_layout_engine("none")  # which would draw twice more
        figure.savefig(path, dpi=40)

    monkeypatch.setattr(statistics, "N_RESAMPLES", 100)  # how wide intervals are is tested there
    monkeypatch.setattr(paper, "save_figure", save_a_sketch)
    before = dict(mpl.rcParams)
    paper.draw(out=tmp_path)
    assert dict(mpl.rcParams) == before
    names = {
        f"{settings}_figure_{figure}{ending}.png"
        for settings, figures in paper.FIGURES.items()
        for figure in figures
        for ending in paper.THEMES
    }
    assert {path.name for path in tmp_path.iterdir()} == names
    for folder in (tmp_path, paper.IMAGES):
        for name in names:
            picture = np.asarray(Image.open(folder / name).convert("L")).astype(float)
            assert (picture[0, 0] < 60) == ("dark" in name)
            assert picture.std() > 10


def test_no_figure_has_fewer_than_three_seeds():
    for settings, figures in paper.FIGURES.items():
        tables = paper.Tables(settings)
        for figure in figures:
            for env, panel in series_of(figure).items():
                for series in panel:
                    n = len(tables.curves(series, env, "coverage"))
                    # Its defaults are the paper's settings.
                    is_missing = settings == "tuned" and series.algorithm == "TD3ICM" and n == 0
                    assert n >= 3 or is_missing, (settings, figure, env, series)


def test_the_public_selection_takes_the_first_for_neighbors(tmp_path):
    reasons.main(tmp_path / "runs", timesteps=3 * 56 * 2000)
    paper.collect(tmp_path / "runs", out=tmp_path / "out")
    (run,) = paper.read(tmp_path / "out" / "runs.csv").itertuples()
    assert (run.algorithm, run.variant, run.preset) == ("NSLC", "selection=public", "paper")


def test_of_equal_returns_the_farthest_from_the_first_survive():
    archive = UnstructuredArchive(solution_dim=1, measure_dim=1, target_size=9, k_neighbors=1)
    (emitter,) = reasons.make_emitters(archive, np.zeros(1, np.float32), 0)
    places = np.linspace(0.0, 1.0, 56)[:, None]
    places[30:] += 10.0  # far from the first thirty, near to each other
    emitter.tell(places, np.zeros(56), places, {})
    assert emitter._parents[0] == 11.0
    assert len(emitter._parents) == 7
    emitter.tell(-places, np.ones(56), -places, {})  # which are better than all that survived
    assert len(emitter._survivors) == 56
    assert (emitter._survivors <= 0.0).mean() > 0.5


# -- claims ---------------------------------------------------------------------------------------


class Numbers:
    """Tables of runs whose coverage and best return are these, by algorithm."""

    budget = BUDGETS["paper"]

    def __init__(self, env=US, timesteps=224_000_000, **numbers):
        self.runs = pd.DataFrame(
            [
                {
                    "algorithm": name,
                    "env": env,
                    "variant": "",
                    "seed": seed,
                    "timesteps": timesteps,
                    "first_success_timesteps": 0.4 * timesteps if value else np.nan,
                    "n_rewarding": int(value > 0.0),
                    "best_return": value,
                    "coverage.reachable": value,
                }
                for name, values in numbers.items()
                for seed, value in enumerate(values)
            ]
        )

    def table(self, name):
        assert name == "runs"
        return self.runs


MANY = [0.5, 0.6, 0.7, 0.8, 0.9]
FEW = [0.1, 0.2, 0.3, 0.4, 0.45]
R, N, U = judging.REPRODUCED, judging.NOT_REPRODUCED, judging.UNKNOWN


@pytest.mark.parametrize(
    ("first", "second", "word"),
    [
        (MANY, FEW, R),
        (FEW, MANY, N),
        (MANY, MANY, U),
        (MANY, [*FEW[:4], 0.65], R),  # 8 of 252 orders, and as many the other way
        (MANY, [*FEW[:4], 0.85], U),
        (MANY, [*FEW[:3], 0.75, 0.85], U),
        (MANY[:4], FEW, U),
        (MANY, [], U),
    ],
)
def test_who_is_ahead(first, second, word):
    verdict = judging.ahead("coverage", "NSES", "NSLC", US)(Numbers(NSES=first, NSLC=second))
    assert verdict.word == word
    assert verdict.numbers.startswith("US: coverage 0." if second else "US -")
    assert verdict.numbers.endswith(", 4 runs") == (len(first) == 4)


def test_none_is_as_good_as_another_without_a_reward():
    judge = judging.as_good("best return", "NSES", "NSLC", 0.02, US)
    nothing = judge(Numbers(NSES=[0.0] * 5, NSLC=[0.0] * 5))
    assert nothing == (U, "US: best return 0 against 0: no reward")
    assert judge(Numbers(NSES=MANY, NSLC=[0.0] * 5)).word == R
    assert judge(Numbers(NSES=[0.0] * 5, NSLC=MANY)).word == N


def test_who_had_fewer_steps_is_not_compared():
    half = Numbers(NSES=MANY, NSLC=FEW)
    half.runs.loc[half.runs["algorithm"] == "NSLC", "timesteps"] //= 2
    word, numbers = judging.ahead("coverage", "NSES", "NSLC", US)(half)
    assert (word, numbers) == (U, "US: coverage 0.7 against 0.29, in 50 % of the steps")
    assert judging.ahead("coverage", "NSES", "AURORA", US)(half).word == U
    assert judging.at_least("coverage", "NSES", 0.1, US)(half).word == R
    assert judging.at_least("coverage", "NSLC", 0.1, US)(half).word == U


as_good = judging.as_good("coverage", "NSES", "NSLC", 0.05, US)
nearly = judging.nearly_as_good("coverage", "NSES", "NSLC", US)
SOME = np.array([0.020, 0.020, 0.020, 0.021, 0.019])


@pytest.mark.parametrize(
    ("judge", "first", "second", "word"),
    [
        (as_good, [0.5, 0.5, 0.5, 0.51, 0.49], [0.5, 0.5, 0.5, 0.51, 0.49], R),
        (as_good, MANY, FEW, R),
        (as_good, FEW, MANY, N),
        (as_good, [0.0, 0.0, 0.9, 0.9, 0.9], [0.6] * 5, U),
        (nearly, MANY, FEW, R),
        (nearly, 0.95 * SOME, SOME, R),  # up to a tenth of the other
        (nearly, 0.9 * SOME, SOME, U),
        (nearly, 0.5 * SOME, SOME, N),
        (judging.at_least("coverage", "NSES", 0.4, US), MANY, [], R),
        (judging.at_least("coverage", "NSES", 0.9, US), MANY, [], N),
        (judging.below("coverage", "NSES", 0.9, US), MANY, [], R),
        (judging.below("coverage", "NSES", 0.65, US), MANY, [], U),
        # The first reward came at .4 of the budget.
        (judging.below("share of the budget", "NSES", 0.41, US), [0.5] * 5 + [0.0], [], R),
        (judging.below("share of the budget", "NSES", 0.39, US), [0.5] * 5 + [0.0], [], N),
    ],
)
def test_means_are_compared_up_to_a_margin(judge, first, second, word):
    assert judge(Numbers(NSES=first, NSLC=second)).word == word


def found(n_found, n=5):
    return [0.1] * n_found + [0.0] * (n - n_found)


def test_a_reward_is_found_by_every_run():
    numbers = {"NSES": found(5), "NSLC": found(3), "CMAME": found(2), "AURORA": found(0)}
    words = {"NSES": (R, N), "NSLC": (U, N), "CMAME": (N, U), "AURORA": (N, R)}
    for name, (word, none) in words.items():
        n = np.count_nonzero(numbers[name])
        assert judging.finds(name, US)(Numbers(**numbers)) == (word, f"US {n} of 5")
        assert judging.finds_none(name, US)(Numbers(**numbers)) == (none, f"US {n} of 5")
    for judge in (judging.finds, judging.finds_none):
        assert judge("NSES", US)(Numbers(NSES=found(4, 4))) == (U, "US 4 of 4")


def test_what_is_not_found_in_a_part_of_the_steps_is_not_told():
    tables = Numbers(timesteps=22_400_000, NSES=found(5), AURORA=found(0))
    assert judging.finds("NSES", US)(tables) == (R, "US 5 of 5")
    assert judging.finds_none("NSES", US)(tables) == (N, "US 5 of 5")
    for judge in (judging.finds, judging.finds_none):
        assert judge("AURORA", US)(tables) == (U, "US 0 of 5 in 10 % of the steps")


def test_of_several_things_each_must_hold():
    def saying(word):
        return lambda tables: judging.Verdict(word, word)

    for i, word in enumerate([R, U, N]):
        words = [R, U, N][: i + 1]
        said = "; ".join(f"{each}: {each}" for each in words) if i else R
        assert judging.all_of(*map(saying, words))(None) == (word, said)
    assert judging.all_of(saying(U), saying(U))(None) == (U, U)
    assert judging.opposite(saying(N))(None) == (R, N)


def test_an_environment_that_is_missing_hides_no_other():
    judge = judging.ahead("coverage", "NSES", "NSLC", MAZES[0], US)
    assert judge(Numbers(NSES=FEW, NSLC=MANY)).word == N
    assert judge(Numbers(NSES=MANY, NSLC=FEW)).word == U


def test_what_is_of_rewarded_runs_alone():
    steps = np.arange(10, 101, 10)
    returns = [0.0, 0.0, 0.2, 0.3, 0.3, 0.3, 0.3, 0.4, 0.4, 0.45]
    curve = pd.DataFrame({"timesteps": steps, "best_return": returns, "generation_return": 0.15})
    # From 30 to 100: the middle is 65, where it was .3.
    assert run_numbers.late_gain(curve) == pytest.approx(0.15)
    assert run_numbers.decline(curve) == pytest.approx(0.3)
    nothing = curve.assign(best_return=0.0, generation_return=0.0)
    assert np.isnan(run_numbers.late_gain(nothing))
    assert np.isnan(run_numbers.decline(nothing))


def test_what_is_covered_late_and_what_is_lost_with_whole_states():
    curve = pd.DataFrame({"coverage": [0.1, 0.2, 0.3, 0.4, 0.5, 0.7]})
    assert run_numbers.late_coverage(curve) == pytest.approx(0.4)
    own = Numbers(NSES=[0.5, 0.6]), Numbers(NSES=[0.2, 0.7])
    own[1].runs["variant"] = "behavior=state"
    own[0].runs = pd.concat([own[0].runs, own[1].runs.iloc[:1]])
    lost = run_numbers.coverage_lost(own[0])
    assert lost["NSES", US, "", 0] == pytest.approx(0.3)
    assert np.isnan(lost["NSES", US, "", 1])


def test_regions_of_another_are_those_of_all_its_runs():
    rows = [("CMAME", 0, 0.0), ("CMAME", 1, 10.0), ("CuriosityES", 0, 0.1), ("CuriosityES", 1, 5.0)]
    policies = pd.DataFrame(rows, columns=["algorithm", "seed", "x"]).assign(variant="")
    policies["y"] = policies["x"]
    runs = policies[["algorithm", "seed", "variant"]].assign(env=US, n_rewarding=1)
    tables = SimpleNamespace(table={"projection": policies, "runs": runs}.get)
    shares = run_numbers.share_of_regions(tables, "CMAME")
    assert shares["CuriosityES", US, "", 0] == 0.5
    assert shares["CuriosityES", US, "", 1] == 0.0
    assert run_numbers.share_of_regions(tables, "MAPElites").isna().all()


def test_what_is_left_of_a_bonus_is_that_of_the_second_half():
    bonus = np.r_[np.full(5, 2.0), np.full(45, 9.0), np.full(50, 0.1)]
    assert run_numbers.bonus_left(pd.DataFrame({"bonus": bonus})) == pytest.approx(0.05)
    assert np.isnan(run_numbers.bonus_left(pd.DataFrame({"bonus": np.full(100, np.nan)})))


def squares(**places):
    """Counts in the squares of a maze; a place is (y, x) in maze units."""
    counts = np.zeros((100, 100))
    for (y, x), n in places.values():
        counts[y // 2, x // 2] = n
    return counts


def test_final_states_in_squares():
    """Snake's goal is at (25, 5), its start at (5, 5), a wall from 10 to 20 between."""
    snake = MAZES[0]
    counts = squares(goal=((5, 25), 3), start=((5, 5), 90), far=((195, 195), 7))
    assert run_numbers.share_near_goal(snake, counts) == pytest.approx(0.03)
    even = run_numbers._is_reachable(snake).astype(float)
    middle = squares(middle=((95, 100), 9))
    for counts, density in ((even, 1.0), (squares(start=((5, 5), 9)), 0.0), (middle, 3.0)):
        assert run_numbers.middle_of_snake(snake, counts) == pytest.approx(density, rel=0.1)
    assert run_numbers.evenness(snake, even) == pytest.approx(1.0)
    of_two = np.log(2.0) / np.log(even.sum())
    assert run_numbers.evenness(snake, squares(a=((5, 5), 5), b=((9, 5), 5))) == pytest.approx(
        of_two
    )
    assert run_numbers.evenness(snake, squares(a=((5, 5), 1), b=((9, 5), 99))) < of_two


def test_routes_of_all_policies_are_counted_and_of_many_expected():
    assert run_numbers.expected_kinds(pd.Series([0, 0, 1])) == 2.0
    routes = np.repeat([0, 1, 2], [80, 15, 5])
    rng = np.random.default_rng(0)
    drawn = [len(set(rng.permutation(routes)[: run_numbers.N_POLICIES])) for _ in range(20_000)]
    found = run_numbers.expected_kinds(pd.Series(routes))
    assert found == pytest.approx(np.mean(drawn), abs=0.02)


def test_a_way_is_a_route_however_long_it_takes():
    def states(*positions):
        squares = np.array(positions, dtype=np.float32) / 100.0 - 1.0
        return np.column_stack([squares, np.zeros((len(squares), 34), dtype=np.float32)])

    slow = states((5, 5), (6, 5), (19, 5), (25, 5), (25, 5))
    fast = states((1, 1), (39, 19), (39, 19))
    back = states((1, 1), (39, 19), (1, 1), (39, 19))
    other = states((5, 5), (5, 25))
    assert paper._route(slow) == paper._route(fast) == paper._route(back) != paper._route(other)


def test_every_claim_has_a_verdict():
    for settings in paper.FIGURES:
        verdicts = paper_tables.judge(settings)
        assert len(verdicts) == len(CLAIMS)
        for claim, (word, numbers) in zip(CLAIMS, verdicts, strict=True):
            assert word in {R, N, U}
            assert numbers, claim
    assert len({claim.text for claim in CLAIMS}) == len(CLAIMS)


# -- what the page says ---------------------------------------------------------------------------

DOCS = Path(__file__).parents[1] / "docs"
CHECK = typer.Typer()
CHECK.command()(claims.main)


@pytest.mark.parametrize("page", prose.STATEMENTS)
def test_pages_say_what_the_data_say(page):
    assert prose.faults(page) == []
    text = prose.one_line((DOCS / page).read_text())
    for false in ("by far the most rewarding", "nothing matters more", "need more are not judged"):
        assert false not in text


@pytest.mark.parametrize(
    ("page", "said", "false"),
    [
        # NS-ES finds more of them in every maze.
        ("paper.md", r"([\d,]+) against ([\d,]+) in Snake", r"\2 against \1 in Snake"),
        ("paper.md", "some dozens or fewer", "7 or fewer than 99"),
        ("paper_claims.md", "5 % of all", "7 % of all"),
        ("reproduce.md", r"\d+ steps a second", "9999 steps a second"),
    ],
)
def test_a_false_number_in_a_page_is_found(page, said, false, tmp_path, monkeypatch):
    text = (DOCS / page).read_text()
    wrong, n = re.subn(said, false, text)
    assert n == 1
    (docs := tmp_path / "docs").mkdir()
    for name in prose.STATEMENTS:
        shutil.copy(DOCS / name, docs / name)
    monkeypatch.setattr(prose, "DOCS", docs)
    (docs / page).write_text(wrong)
    result = CliRunner().invoke(CHECK, ["--check"])
    assert result.exit_code == 1
    assert result.output.startswith(f"{page}: ")


def test_the_pages_say_what_judges_claims():
    claims_page = prose.one_line((DOCS / "paper_claims.md").read_text())
    assert f"at most {100 * judging.LEVEL:.0f} % of all cases" in claims_page
    assert judging.LEAST_RUNS == 5
    assert "A verdict needs five runs of each algorithm" in claims_page
