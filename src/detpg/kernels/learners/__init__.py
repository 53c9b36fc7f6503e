"""The learners of Section 5.2, one file each, by their names in `ALGORITHMS`."""

from detpg.kernels.learners import copdac_gq, copdac_q, offpac, stochastic_ac
from detpg.kernels.learners.learner import Learner

LEARNERS: dict[str, Learner] = {
    "copdac-gq": copdac_gq.LEARNER,
    "copdac-q": copdac_q.LEARNER,
    "offpac": offpac.LEARNER,
    "stochastic-ac": stochastic_ac.LEARNER,
}

__all__ = ["LEARNERS", "Learner"]
