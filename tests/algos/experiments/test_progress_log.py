import numpy as np
import pytest

from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.progress_log import ProgressLog

TIMESTEPS = "time/total_timesteps"


def read_rows(path):
    return [row.dropna().to_dict() for _, row in Run(path.parent).progress.iterrows()]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "progress.csv"


def log_rows(path, first, last, **values):
    """Go on with a log after `first` timesteps, with a row for each until `last`."""
    stands = {}
    log = ProgressLog(path, first, lambda: stands)
    for i in range(first + 1, last + 1):
        stands |= {TIMESTEPS: i, "coverage/all": i / 3}
        log.write({"time/fps": 1} | ({"odd": i / 7} if i % 2 else {}) | values, {})
    return log


def test_rows_after_a_checkpoint_are_dropped(path):
    log_rows(path, 0, 6)
    log_rows(path, 3, 5)
    rows = read_rows(path)
    assert [row[TIMESTEPS] for row in rows] == [1, 2, 3, 4, 5]
    assert [row["coverage/all"] for row in rows] == [i / 3 for i in range(1, 6)]
    assert [row.get("odd") for row in rows] == [1 / 7, None, 3 / 7, None, 5 / 7]


def test_what_others_empty_the_logger_of_waits_for_the_next_row(path):
    log = log_rows(path, 0, 1)
    log.write({"eval/mean_reward": 5.0, TIMESTEPS: 9}, {"eval/mean_reward": ()})
    assert len(read_rows(path)) == 1
    log.write({"time/fps": 1, "left out": 3}, {"left out": ("csv",)})
    last = read_rows(path)[-1]
    assert (last["eval/mean_reward"], last[TIMESTEPS]) == (5.0, 1)
    assert "left out" not in last


def test_the_last_row_is_written_once(path):
    stands = {TIMESTEPS: 3, "coverage/all": 1 / 3, "time/seconds": 1.5}
    for _ in range(2):
        log = ProgressLog(path, 3, lambda: stands)
        stands["time/seconds"] += 1.0
        log.end({"train/loss": 2.0})
    assert [row["train/loss"] for row in read_rows(path)] == [2.0]


def test_a_number_has_the_digits_that_a_checkpoint_gives_it(path):
    log_rows(path, 0, 1, loss=np.float32(0.1))
    assert repr(float(np.float32(0.1))) in path.read_text()


TEXTS = ["007", "1e5", "-5", "Infinity", "é", 'a "b", c', "a\x0bb\x85\u2028c", "a\r\nb"]


@pytest.mark.parametrize("text", TEXTS)
def test_a_text_stays_as_it_is_in_one_line_when_another_column_comes(text, path):
    log = log_rows(path, 0, 1, **{"mine/é": text, "flag": True, "picture": object()})
    header, row, _ = path.read_bytes().split(b"\n")
    assert b"picture" not in header
    log.write({"time/fps": 1, "z": 0}, {})
    log_rows(path, 1, 1)
    assert path.read_bytes().split(b"\n")[1] == row + b","


def test_columns_have_one_order_whenever_they_appear(path, tmp_path):
    stands = {TIMESTEPS: 1, "time/seconds": 0.5, "coverage/all": 0.1}
    for logged in (["a", "train/z"], ["train/z"]), (["train/z"], ["a"]):
        log = ProgressLog(path, 0, lambda: stands)
        for names in logged:
            log.write({"time/fps": 1} | dict.fromkeys(names, 2.0), {})
        header = path.read_text().splitlines()[0]
        assert header == f"{TIMESTEPS},time/seconds,a,coverage/all,time/fps,train/z"
        assert [row.get("a") for row in read_rows(path)].count(2.0) == 1
        path.unlink()


def test_half_a_row_is_dropped(path):
    log_rows(path, 0, 3)
    path.write_text(path.read_text()[:-2])
    log_rows(path, 2, 3)
    assert [row[TIMESTEPS] for row in read_rows(path)] == [1, 2, 3]
