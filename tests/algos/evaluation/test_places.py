"""Places, and the actions that lead there."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from curiosity_algos.evaluation.places import Place, Places


def grow(steps):
    """Places of which each goes on from an earlier one: (which, its actions)."""
    places = Places(np.zeros((0, 1)))
    ways, known, numbers = [[]], [places.start()], []
    for before, actions in steps:
        i = before % len(known)
        ways.append(ways[i] + actions)
        trail = known[i].trail.then(np.array(actions, dtype=float)[:, None])
        known.append(Place(trail, float(sum(ways[-1])), state=i))
        numbers += places.add([known[-1]])
    return places, dict(zip(numbers, ways[1:], strict=True))


STEPS = st.lists(st.tuples(st.integers(0, 50), st.lists(st.integers(0, 9), min_size=1)), max_size=9)


@given(STEPS, st.data())
def test_a_file_has_the_ways_to_those_that_are_kept(steps, data):
    places, ways = grow(steps)
    kept = data.draw(st.lists(st.sampled_from(sorted(ways)), unique=True)) if ways else []
    places.keep(kept)
    read = Places(np.zeros((0, 1)))
    read.load_state_dict(places.state_dict())
    for number in kept:
        for place in (places[number], read[number]):
            assert place.actions.ravel().tolist() == ways[number]
            assert place.length == len(ways[number])
            assert place.total == sum(ways[number])
        assert read[number].state is None
    np.testing.assert_equal(read.state_dict(), places.state_dict())


def test_numbers_go_on_after_a_file():
    places, ways = grow([(0, [1]), (1, [2])])
    read = Places(np.zeros((0, 1)))
    read.load_state_dict(places.state_dict())
    (number,) = read.add([read.start()])
    assert number not in ways
    assert read.start().length == 0
