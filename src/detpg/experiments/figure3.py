"""Figure 3: the octopus arm of Section 5.3, with a policy and a value that are networks."""

from detpg.experiments.figure3_claims import VERDICTS, judge
from detpg.experiments.octopus_shards import FURTHER, run_octopus_shard
from detpg.experiments.study import Arm, Condition, Preset, Study

INTERVAL = 15_000
TIMES = tuple(range(INTERVAL, 300_001, INTERVAL))

ARMS: tuple[Arm, ...] = ()
