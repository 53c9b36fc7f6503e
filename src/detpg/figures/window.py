"""A window on the screen that shows one picture after the other."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.backends.registry import BackendFilter, backend_registry


class Window:
    """A window, or one sentence that says why there is none; once closed, it stays closed."""

    def __init__(self, title: str):
        """Prepares the window, which opens with the first picture.

        Raises:
            RuntimeError: No display, or matplotlib was told to draw without one.
        """
        backend = plt.get_backend()
        drawn = None
        if backend.lower() in backend_registry.list_builtin(BackendFilter.INTERACTIVE):
            try:
                with plt.rc_context({"toolbar": "None"}):
                    drawn = plt.figure(title, figsize=(4.8, 4.8))
            except Exception:  # each toolkit has its own error where there is no display
                drawn = None
        if drawn is None:
            raise RuntimeError(
                f"There is no display for a window (matplotlib's backend is {backend!r}): choose "
                "render_mode 'rgb_array', or set MPLBACKEND to one that has a window."
            )
        self._figure, self._image = drawn, None

    def show(self, picture: np.ndarray, seconds: float) -> None:
        """Shows a picture, for a while.

        Args:
            picture: uint8, shape (height, width, 3), of one size each time.
            seconds: How long to wait for the window to draw it.
        """
        if not plt.fignum_exists(self._figure.number):
            return
        if self._image is None:
            axes = self._figure.add_axes((0, 0, 1, 1))
            axes.set_axis_off()
            self._image = axes.imshow(picture)
            self._figure.show()
        self._image.set_data(picture)
        self._figure.canvas.draw_idle()
        self._figure.canvas.start_event_loop(seconds)

    def close(self) -> None:
        """Closes it, if it is open."""
        plt.close(self._figure)
