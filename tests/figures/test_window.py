"""The window, without a display: matplotlib's own canvas stands in for one."""

import numpy as np
import pytest
from matplotlib.backends.registry import backend_registry

from detpg.figures.window import Window


def test_no_display_is_said(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(backend_registry, "list_builtin", lambda kind: [])
    with pytest.raises(RuntimeError, match=r"^There is no display for a window .*\.$"):
        Window("arm")


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
def test_pictures_follow_one_another(monkeypatch: pytest.MonkeyPatch):
    import matplotlib.pyplot as plt

    plt.switch_backend("agg")
    monkeypatch.setattr(backend_registry, "list_builtin", lambda kind: ["agg"])
    window = Window("arm")
    (number,) = plt.get_fignums()
    (one, other) = (np.full((8, 8, 3), value, np.uint8) for value in (10, 200))
    for picture in (one, other):
        window.show(picture, 0.01)
        (image,) = plt.figure(number).axes[0].images
        np.testing.assert_array_equal(image.get_array(), picture)
    plt.close(number)
    window.show(one, 0.01)  # closed by hand: it stays closed
    window.close()
    assert plt.get_fignums() == []
