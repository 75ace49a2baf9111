"""What the three hosts of a bonus promise alike: motivation, VecEnv wrapper and replay buffer."""

import copy

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from padded_rollouts import N_OBSERVATIONS, make_rollouts
from recorder import Count, Recorder
from stable_baselines3.common.vec_env import DummyVecEnv
from torch_threads import heavy_threads

from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.icm import ICM
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.motivations.curiosity import CuriosityMotivation
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer
from curiosity_algos.state import file

OBSERVATIONS, ACTIONS = spaces.Box(-99, 99, (N_OBSERVATIONS,)), spaces.Box(-1, 1, (2,))
SMALL = {"n_updates": 2, "batch_size": 4, "seed": 0, "device": "cpu"}
SAMPLED = [name for name, bonus in BONUSES.items() if bonus.episodes is Bonus.episodes]


class Scored(Recorder):
    """A bonus that scores as it is asked to."""

    def __init__(self, value=1.0):
        super().__init__()
        self.value = value

    def score(self, observations, actions, next_observations):
        return np.full(len(observations), self.value)


class Counted(Count):
    observation_space, action_space = OBSERVATIONS, ACTIONS


class Motivation:
    """Of each host how it is made, and what it says of so many steps that it collects."""

    bonuses = tuple(BONUSES)

    def make(self, **settings):
        settings = {"n_states": None, "n_transitions": 5, "buffer_size": 60} | SMALL | settings
        settings |= {"n_threads": 1}  # the caller's own, which alone `heavy_threads` watches
        return CuriosityMotivation(OBSERVATIONS, ACTIONS, **settings)

    def collect(self, host, seed, scale=1.0):
        rollouts = make_rollouts(seed=seed)
        rollouts.observations[:] *= scale
        host.update(rollouts)
        return host.score(rollouts)


class Wrapper:
    bonuses = tuple(BONUSES)

    def make(self, **settings):
        settings = {"train_interval": 8, "buffer_size": 60} | SMALL | settings
        return BonusVecEnvWrapper(DummyVecEnv([Counted] * 2), **settings)

    def collect(self, host, seed, scale=1.0):
        rng = np.random.default_rng(seed)
        for env in host.unwrapped.envs:
            env.unwrapped.scale = scale
        host.reset()
        actions = rng.uniform(-1, 1, (11, 2, 2)).astype(np.float32)
        return np.array([host.step(action)[1] for action in actions])


class Buffer:
    bonuses = SAMPLED

    def make(self, **settings):
        settings = {"train_interval": 8} | SMALL | settings
        size = settings.pop("buffer_size", 16)  # fewer than it collects
        device = settings.pop("device")
        return BonusReplayBuffer(size, OBSERVATIONS, ACTIONS, device, 2, **settings)

    def collect(self, host, seed, scale=1.0):
        rng = np.random.default_rng(seed)
        for step in range(11):
            before, after = (np.full((2, N_OBSERVATIONS), step % 4 + i) * scale for i in (0, 1))
            actions, ends = rng.uniform(-1, 1, (2, 2)), np.full(2, step % 4 == 3)
            host.add(before, after, actions, np.zeros(2), ends, [{}, {}])
        return host.sample(16).rewards.numpy()


HOSTS = {"motivation": Motivation(), "wrapper": Wrapper(), "buffer": Buffer()}


@pytest.fixture(params=HOSTS)
def host(request):
    return HOSTS[request.param]


def of_every_bonus():
    return [pytest.param(host, name) for host in HOSTS.values() for name in host.bonuses]


def through_a_file(state, path):
    file.save(path, "a host", {}, state)
    return file.read(path, "a host")[1]


@pytest.mark.parametrize(("host", "bonus"), of_every_bonus())
class TestEveryBonus:
    def test_a_state_goes_on_bit_for_bit(self, host, bonus, tmp_path, assert_same):
        one, twin = (host.make(bonus=bonus, seed=seed) for seed in (0, 1))
        host.collect(one, 0)
        twin.load_state_dict(through_a_file(one.state_dict(), tmp_path / "state.npz"))
        assert_same(one.state_dict(), twin.state_dict())
        for seed in (1, 2):
            np.testing.assert_array_equal(*(host.collect(each, seed) for each in (one, twin)))
        states = [each.state_dict() for each in (one, twin)]
        for state in states:
            state.pop("found", None)  # where episodes began, by unseeded environments
        assert_same(*states)

    def test_it_has_one_of_torchs_threads(self, host, bonus):
        made = host.make(bonus=bonus)
        with heavy_threads() as threads:
            host.collect(made, 0)
        assert made.curiosity.n_trainings
        assert threads == {1}


def test_seeds_decide(host):
    made = [host.make(bonus="rnd", seed=seed) for seed in (0, 0, 1)]
    weights = [next(each.bonus.parameters()).detach().numpy().copy() for each in made]
    values = [host.collect(each, 0) for each in made]
    for one, twin, other in (weights, values):
        np.testing.assert_array_equal(one, twin)
        assert not np.array_equal(one, other)


class TestTraining:
    def test_so_many_steps_on_batches_of_what_came(self, host):
        bonus = Scored()
        made = host.make(bonus=bonus, n_updates=3, batch_size=7)
        host.collect(made, 0)
        assert len(bonus.batches) == 3 * made.curiosity.n_trainings > 0
        shapes = [(7, N_OBSERVATIONS), (7, 2), (7, N_OBSERVATIONS)]
        assert all([part.shape for part in batch] == shapes for batch in bonus.batches)
        assert made.curiosity.metrics["recorder/loss"] == len(bonus.batches) - 1

    @pytest.mark.parametrize("without", [th.no_grad, th.inference_mode])
    def test_it_needs_gradients(self, host, without):
        made = host.make(bonus="rnd")
        with without(), pytest.raises(RuntimeError, match=r"must be called outside torch\.no_"):
            host.collect(made, 0)

    def test_the_bonus_observes_where_the_task_ended_episodes(self, host):
        bonus = Scored()
        host.collect(host.make(bonus=bonus), 0)
        spared = Scored()
        spared.observes_ends = False
        host.collect(host.make(bonus=spared), 0)
        n_observed = [sum(map(len, each.observed)) for each in (bonus, spared)]
        assert n_observed[0] > n_observed[1] > 0

    @pytest.mark.parametrize(
        ("scale", "fault"),
        [
            (1.0, "`bonus` must give finite scores, it gave others"),
            (1e20, r"`env` must give observations of at most 1e\+18"),
        ],
    )
    def test_who_is_at_fault_is_named(self, host, scale, fault):
        with pytest.raises(ValueError, match=fault):
            host.collect(host.make(bonus=Scored(np.nan)), 0, scale)


def test_a_state_of_another_bonus_changes_nothing(host, assert_same):
    made, other = host.make(bonus="rnd"), host.make(bonus="rnd", bonus_kwargs={"hidden": 8})
    host.collect(made, 0)
    host.collect(other, 1)
    before = copy.deepcopy(made.state_dict())
    with pytest.raises(ValueError, match="`bonus` must be made as the one that was saved"):
        made.curiosity.load_state_dict(other.state_dict()["curiosity"])
    assert_same(made.state_dict(), before)


class TestSettings:
    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("bonus", "count"),
            ("bonus", Scored),
            ("bonus_kwargs", {"widths": 3}),
            ("bonus_kwargs", 3),
            ("weight", -0.1),
            ("extrinsic", "no"),
            ("norm_reward", "no"),
            ("gamma", 1.1),
            ("train_interval", 0),
            ("n_updates", 0),
            ("buffer_size", 0),
            ("seed", -1),
        ],
    )
    def test_errors_name_the_argument(self, host, name, value):
        of_rewards = "weight", "extrinsic", "norm_reward", "train_interval"
        if host is HOSTS["motivation"] and name in of_rewards:
            pytest.skip("evolution weighs by `phi`, and trains once a generation")
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            host.make(**{name: value})

    def test_an_object_takes_no_keywords(self, host):
        bonus = ICM(OBSERVATIONS, ACTIONS, device="cpu")
        with pytest.raises(ValueError, match="`bonus_kwargs` must be empty"):
            host.make(bonus=bonus, bonus_kwargs={"hidden": 3})
        assert host.make(bonus=bonus).bonus is bonus

    def test_a_change_is_in_force_at_once(self, host):
        made = host.make(bonus=(bonus := Scored()))
        made.n_updates, made.batch_size = 1, np.int64(9)
        host.collect(made, 0)
        assert len(bonus.batches) == made.curiosity.n_trainings
        assert {len(batch[0]) for batch in bonus.batches} == {9}
        assert type(made.batch_size) is int

    def test_the_bonus_stays(self, host):
        made = host.make()
        made.bonus = made.bonus
        with pytest.raises(ValueError, match=r"^`bonus` must stay as it was set: make a new "):
            made.bonus = Scored()
        with pytest.raises(ValueError, match=r"^`learning_rate` must stay as it was set"):
            made.bonus.learning_rate = 1e-5


@pytest.fixture(params=["wrapper", "buffer"])
def payer(request):
    """A host that adds the bonus to the reward of one policy."""
    return HOSTS[request.param]


class TestForOnePolicy:
    def test_defaults_make_what_is_rare_stand_out_and_the_icm_slow(self, payer):
        assert payer.make().bonus.name == "apt"
        for given, expected in [({}, (3.0, 10)), ({"power": 1.0, "horizon": 100}, (1.0, 100))]:
            bonus = payer.make(bonus="apt", bonus_kwargs=given).bonus
            assert (bonus.power, bonus.horizon) == expected
        for given, expected in [({}, 1e-4), ({"learning_rate": 0.1}, 0.1)]:
            bonus = payer.make(bonus="icm", bonus_kwargs=given).bonus
            assert bonus.optimizer.param_groups[0]["lr"] == expected

    def test_the_first_step_of_an_episode_does_not_outweigh_all_others(self):
        for given, expected in [({}, True), ({"log": False}, False)]:
            assert HOSTS["wrapper"].make(bonus="e3b", bonus_kwargs=given).bonus.log is expected

    def test_changes_are_in_the_file(self, payer, tmp_path):
        changes = {"weight": 0.0, "extrinsic": False, "train_interval": 4, "gamma": 0.5}
        changes |= {"n_updates": 3, "batch_size": 5, "norm_reward": not payer.make().norm_reward}
        made, again = payer.make(), payer.make()
        for name, value in changes.items():
            setattr(made, name, value)
        made.save(tmp_path / "host.npz")
        if payer is HOSTS["wrapper"]:
            again = BonusVecEnvWrapper.load(tmp_path / "host.npz", made.venv)
        else:
            again.restore(tmp_path / "host.npz")
        assert changes.items() <= again.settings.items()

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("weight", -1.0),
            ("extrinsic", 2),
            ("norm_reward", 2),
            ("train_interval", 0),
            ("gamma", 1.0),
        ],
    )
    def test_what_a_change_may_be_is_said_at_once(self, payer, name, value):
        made = payer.make()
        before = made.settings
        with pytest.raises(ValueError, match=f"^`{name}` must be "):
            setattr(made, name, value)
        assert made.settings == before

    @pytest.mark.parametrize("name", ["bonus_kwargs", "buffer_size", "observation_key", "seed"])
    def test_what_parts_were_made_with_stays(self, payer, name):
        with pytest.raises(ValueError, match=f"^`{name}` must stay as it was set: make a new "):
            setattr(payer.make(), name, 1)

    def test_a_state_that_no_file_holds_is_not_written(self, payer, tmp_path):
        made = payer.make(bonus=(bonus := Scored()))
        bonus.state_dict = lambda: {"thing": object()}
        with pytest.raises(ValueError, match="A state must hold arrays of numbers"):
            made.save(tmp_path / "host.npz")
        assert not list(tmp_path.iterdir())
