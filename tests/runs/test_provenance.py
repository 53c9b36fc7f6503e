import sys

import jax

from detpg.runs import provenance


def test_provenance_names_command_versions_and_config(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/detpg", "reproduce", "--seed", "3"])
    found = provenance({"seed": 3})
    assert found["command"] == "detpg reproduce --seed 3"
    assert found["config"] == {"seed": 3}
    assert found["versions"]["jax"] == jax.__version__
    assert found["git"] is None or len(found["git"]["commit"]) == 40
