"""Conformance: does one's own environment or algorithm keep the protocols of `detpg.types`?

    from detpg.testing import check_algorithm, check_environment, check_gymnasium

    check_environment(MyEnvironment())
    check_algorithm(MyAlgorithm.create(MyEnvironment().spec), MyEnvironment())
    findings = check_gymnasium("mine:MyWorld-v0")

And does the algorithm learn what is known of the smallest worlds (`detpg.testing.probes`)?

    from detpg.testing import PROBES, check_probe

    for probe in PROBES.values():
        check_probe(MyAlgorithm.create(probe.spec), probe)

In: a record. Out: nothing, or an `AssertionError` of one sentence: what was found, what was
expected, how to mend it. What is checked is what batching a study over seeds and hyper-parameters,
and resuming it from files, depends on. Of a Gymnasium environment: a list of findings, for what
stands in the way of learning is not always a mistake.
"""

from detpg.testing.algorithm import check_algorithm
from detpg.testing.environment import check_environment
from detpg.testing.findings import Finding
from detpg.testing.gymnasium_world import check_gymnasium
from detpg.testing.probes import PROBES, Probe, check_probe

__all__ = [
    "PROBES",
    "Finding",
    "Probe",
    "check_algorithm",
    "check_environment",
    "check_gymnasium",
    "check_probe",
]
