"""The training script of rl-zoo3, with our algorithms and what to try of them beside its own.

`python examples/rl_zoo3_train.py --algo CuriosityES --env CuriosityMaze-US-v0 --conf-file
examples/rl_zoo3.yml --log-folder runs`; the docs have a page on it, `docs/rl_zoo3.md`.
"""

from rl_zoo3.hyperparams_opt import HYPERPARAMS_CONVERTER, HYPERPARAMS_SAMPLER
from rl_zoo3.train import ALGOS, train
from rl_zoo3_spaces import SPACES, convert, sampler

from curiosity_algos.common.names import ALGORITHMS, find_algorithm

ALGOS.update({name: find_algorithm(name) for name in ALGORITHMS})
HYPERPARAMS_SAMPLER.update({name: sampler(name) for name in SPACES})
HYPERPARAMS_CONVERTER.update(dict.fromkeys(SPACES, convert))
if __name__ == "__main__":
    train()
