import pytest

from curiosity_algos.experiments.conf_file import complete, read_conf_file
from curiosity_algos.experiments.training import RunSpec

FILE = """
CuriosityMaze-US-v0:
  n_timesteps: !!float 3e4
  env_kwargs: {horizon: 50, beams: 8}
  sigma: 0.1
  k: 3
default:
  sigma: 0.2
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "conf.yml"
        path.write_text(text)
        return path

    return write


def run(env="CuriosityMaze-US-v0", **changes):
    return RunSpec("nses", env, 0, 1e7, **changes)


def test_a_file_completes_a_run(write):
    completed = complete(run(), read_conf_file(write(FILE)), None)
    assert completed.timesteps == 3e4
    assert completed.env_kwargs == {"horizon": 50, "beams": 8}
    assert completed.settings == {"sigma": 0.1, "k": 3}


def test_what_a_run_has_counts_more(write):
    given = run(env_kwargs={"horizon": 9}, settings={"k": 5})
    completed = complete(given, read_conf_file(write(FILE)), 12.0)
    assert completed.timesteps == 12.0
    assert completed.env_kwargs == {"horizon": 9, "beams": 8}
    assert completed.settings == {"sigma": 0.1, "k": 5}


def test_modules_of_ids_do_not_count_and_others_have_the_default(write):
    table = read_conf_file(write(FILE))
    assert complete(run("curiosity_gym:CuriosityMaze-US-v0"), table, None).timesteps == 3e4
    other = complete(run("Pendulum-v1"), table, None)
    assert (other.timesteps, other.settings) == (1e7, {"sigma": 0.2})


def test_a_budget_without_a_point_is_a_number(write):
    # YAML takes it for text.
    table = read_conf_file(write("default: {n_timesteps: 1e4}"))
    assert complete(run(), table, None).timesteps == 1e4
    table = read_conf_file(write("default: {n_timesteps: many}"))
    with pytest.raises(ValueError, match="`n_timesteps` must be a number, got 'many'"):
        complete(run(), table, None)


def test_other_files_are_refused(write):
    for text in ["", "3", "- a", "a: 3", "a: {1: 2}", "a: [b", "a: \x00"]:
        with pytest.raises(ValueError, match=r"^`conf_file` must"):
            read_conf_file(write(text))


def test_every_environment_must_be_there(write):
    table = read_conf_file(write("Pendulum-v1: {}"))
    with pytest.raises(ValueError, match="CuriosityMaze-US-v0 or default, it has Pendulum-v1"):
        complete(run(), table, None)
    with pytest.raises(ValueError, match="`env_kwargs` must be keywords"):
        complete(run(), {"default": {"env_kwargs": 3}}, None)
