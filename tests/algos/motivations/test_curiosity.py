import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from padded_rollouts import LENGTHS, N_OBSERVATIONS, make_rollouts, only
from recorder import Recorder

from curiosity_algos.motivations.curiosity import CuriosityMotivation


class PartsRecorder(Recorder):
    """Tells all parts of a transition apart."""

    def score_trajectory(self, observations, actions):
        assert len(observations) == len(actions) + 1
        return (4 * observations[1:] + 2 * observations[:-1])[:, 0] + actions[:, 0]

    def score(self, observations, actions, next_observations):
        return np.zeros(len(observations))


def make_motivation(bonus=None, *, action_space=None, **changes):
    settings = {"bonus": bonus or "icm", "gamma": 0.9, "n_states": None, "buffer_size": 1000}
    settings |= {"n_transitions": 6, "n_updates": 3, "batch_size": 8, "seed": 0, "device": "cpu"}
    return CuriosityMotivation(
        spaces.Box(-1, 1, (N_OBSERVATIONS,)),
        action_space or spaces.Box(-1, 1, (2,)),
        **(settings | changes),
    )


class TestScore:
    @pytest.mark.parametrize(("n_states", "n_together"), [(1, 8), (3, 1), (8, 2), (49, 8)])
    def test_some_states_are_enough(self, n_states, n_together, monkeypatch):
        monkeypatch.setattr("curiosity_algos.motivations.curiosity.N_TOGETHER", n_together)

        class WhereItLeads(PartsRecorder):
            def score(self, observations, actions, next_observations):
                return self.score_trajectory(
                    np.concatenate([observations[:1], next_observations]), actions
                )

            def score_trajectory(self, observations, actions):
                return observations[1:, 0]

        rollouts = make_rollouts()
        motivation = make_motivation(WhereItLeads(), n_states=n_states, gamma=1.0)
        scores = motivation.score(rollouts)
        for i, length in enumerate(LENGTHS):
            ends = [-(-j * length // n_states) for j in range(1, n_states + 1)]
            assert ends[-1] == length
            values = sorted(float(rollouts.observations[i, end, 0]) for end in ends)
            highest = values[-max(1, n_states // 4) :]
            assert scores[i] == pytest.approx(sum(highest) / len(highest), rel=1e-5)

    @pytest.mark.parametrize("bonus", ["e3b", "etd", "ngu", "noveld"])
    def test_a_bonus_with_a_memory_sees_every_state(self, bonus):
        rollouts = make_rollouts()
        motivation = make_motivation(bonus, n_states=8, gamma=1.0)
        scores = motivation.score(rollouts)
        for i, length in enumerate(LENGTHS):
            seen, taken = rollouts.observations[i, : length + 1], rollouts.actions[i, :length]
            curiosity = motivation.bonus.score_trajectory(seen, taken)
            some = sorted(curiosity[-(-j * length // 8) - 1] for j in range(1, 9))
            assert scores[i] == pytest.approx(np.mean(some[-2:]), rel=1e-5)

    @pytest.mark.parametrize("gamma", [0.0, 0.99, 1.0])
    def test_equals_the_papers_sum(self, gamma):
        rollouts = make_rollouts()
        motivation = make_motivation(gamma=gamma)
        expected = []
        for i, length in enumerate(LENGTHS):
            score = 0.0
            for t in range(length):
                pair = rollouts.observations[i, t : t + 1], rollouts.actions[i, t : t + 1]
                after = rollouts.observations[i, t + 1 : t + 2]
                score += gamma ** (length - 1 - t) * float(motivation.bonus.score(*pair, after)[0])
            expected.append(score)
        np.testing.assert_allclose(motivation.score(rollouts), expected, rtol=1e-5)

    @pytest.mark.parametrize("is_discrete", [False, True])
    @pytest.mark.parametrize("how", [{}, {"gamma": 1.0, "n_states": 4}])
    def test_threads_change_no_bit(self, is_discrete, how, monkeypatch):
        monkeypatch.setattr("curiosity_algos.motivations.curiosity.N_TOGETHER", 2)
        action_space = spaces.Discrete(3) if is_discrete else None
        rollouts = make_rollouts(is_discrete)
        scores = []
        for n_threads, n_torch_threads in [(1, 1), (1, 2), (2, 1), (4, 2), (None, 4)]:
            th.set_num_threads(n_torch_threads)
            motivation = make_motivation(action_space=action_space, n_threads=n_threads, **how)
            scores.append(motivation.score(rollouts))
            assert th.get_num_threads() == n_torch_threads
        assert np.isfinite(scores[0]).all()
        for other in scores[1:]:
            np.testing.assert_array_equal(other, scores[0])

    def test_an_individual_scores_the_same_in_any_company(self):
        rollouts = make_rollouts()
        motivation = make_motivation()
        alone = [motivation.score(only(rollouts, slice(i, i + 1)))[0] for i in range(len(LENGTHS))]
        np.testing.assert_array_equal(motivation.score(rollouts), alone)


class TestUpdate:
    def test_remembers_transitions_of_every_individual(self):
        rollouts, motivation = make_rollouts(), make_motivation(PartsRecorder(), n_transitions=40)
        motivation.update(rollouts)
        assert len(motivation.buffer) == 40 * len(LENGTHS)
        held = motivation.buffer.state_dict()
        columns = [held[name] for name in ("observations", "actions", "next_observations")]
        rows = th.cat(columns, dim=1).numpy().reshape(len(LENGTHS), 40, -1)
        for i, length in enumerate(LENGTHS):
            real = np.concatenate(
                [
                    rollouts.observations[i, :length],
                    rollouts.actions[i, :length],
                    rollouts.observations[i, 1 : length + 1],
                ],
                axis=1,
            )
            assert {row.tobytes() for row in rows[i]} <= {row.tobytes() for row in real}
            # 40 uniform draws of so few miss a tenth of them at most.
            assert len(np.unique(rows[i], axis=0)) >= 0.9 * length

    def test_the_bonus_observes_what_enters_the_buffer_and_where_episodes_terminated(self):
        motivation, rollouts = make_motivation(PartsRecorder()), make_rollouts()
        motivation.update(rollouts)
        held = motivation.buffer.state_dict()
        ends = rollouts.final_observations[rollouts.terminated]
        assert len(ends) == 4
        expected = np.concatenate([held["observations"], ends])
        np.testing.assert_array_equal(motivation.bonus.observed[0], expected)


@pytest.mark.parametrize("wrong", [{"n_transitions": 0}, {"n_states": 0, "gamma": 1.0}])
def test_errors_name_the_argument(wrong):
    with pytest.raises(ValueError, match=f"`{next(iter(wrong))}` must be a whole number of at"):
        make_motivation(**wrong)


def test_spaces_are_enough():
    observation_space = spaces.Box(-1, 1, (N_OBSERVATIONS,))
    motivation = CuriosityMotivation(observation_space, spaces.Discrete(3), n_updates=1)
    assert motivation.n_states == 20
    assert (motivation.score(make_rollouts(is_discrete=True)) == 0.0).all()  # none is known
    assert motivation.update(make_rollouts(is_discrete=True))["apt/loss"] > 0.0
    assert (motivation.score(make_rollouts(is_discrete=True, seed=1)) > 0.0).all()
