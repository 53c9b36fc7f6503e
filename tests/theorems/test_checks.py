"""Every check of every group passes, in smaller sizes; its table and its page are whole."""

import pytest
from tests.theorems.sizes import failed

from detpg.theorems import GROUPS


@pytest.mark.parametrize("name", GROUPS)
def test_every_check_passes(x64, name: str):
    assert failed(name) == set()
