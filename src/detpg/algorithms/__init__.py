"""The boxes of the paper: stops 2 to 5 meet here and only here.

In: a transition. Out: the learner's next state and diagnostics.
Next: the loop over time (`detpg.training`).
"""

from detpg.algorithms.bandit_copdac import BanditCOPDAC
from detpg.algorithms.bandit_stochastic_ac import BanditStochasticAC
from detpg.algorithms.copdac_gq import COPDACGQ
from detpg.algorithms.copdac_q import COPDACQ
from detpg.algorithms.dac import DAC
from detpg.algorithms.ddpg import DDPG
from detpg.algorithms.offpac import OffPAC
from detpg.algorithms.opdac import OPDAC
from detpg.algorithms.stochastic_ac import StochasticAC
from detpg.algorithms.td3 import TD3
from detpg.types import Algorithm

ALGORITHMS: dict[str, type[Algorithm]] = {
    "bandit-copdac": BanditCOPDAC,
    "bandit-stochastic-ac": BanditStochasticAC,
    "copdac-gq": COPDACGQ,
    "copdac-q": COPDACQ,
    "dac": DAC,
    "ddpg": DDPG,
    "offpac": OffPAC,
    "opdac": OPDAC,
    "stochastic-ac": StochasticAC,
    "td3": TD3,
}

__all__ = [
    "ALGORITHMS",
    "COPDACGQ",
    "COPDACQ",
    "DAC",
    "DDPG",
    "OPDAC",
    "TD3",
    "BanditCOPDAC",
    "BanditStochasticAC",
    "OffPAC",
    "StochasticAC",
]
