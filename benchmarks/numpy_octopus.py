"""The baseline: the octopus arm in plain NumPy, all nodes (and arms, if any) at once, float64.

Arrays are (side, node or segment, arms ...), as in `detpg.environments.octopus_arm`.
"""

from collections.abc import Iterable

import numpy as np

from detpg.environments.octopus_arm import OctopusParameters

SUB_STEPS, SUB_STEP = 25, 0.2

State = tuple[np.ndarray, ...]  # theta, omega, x, y, vx, vy
Pair = tuple[np.ndarray, np.ndarray]


class NumpyOctopus:
    """The simulator of a number of arms, or of one when `arms` is empty."""

    def __init__(self, parameters: OctopusParameters, arms: tuple[int, ...] = ()):
        sides = np.stack([parameters.upper, parameters.lower]).astype(np.float64)
        (x, y), mass = np.moveaxis(sides, 2, 0), np.asarray(parameters.mass, np.float64)
        length, width = np.hypot(np.diff(x), np.diff(y)), np.hypot(x[0] - x[1], y[0] - y[1])

        def grown(value: np.ndarray) -> np.ndarray:
            return value.reshape(*value.shape, *(1 for _ in arms))

        self.known = {k: np.asarray(v, np.float64) for k, v in vars(parameters).items()}
        self.arms, self.side = arms, grown(np.array([1.0, -1.0]))
        self.x, self.y = grown(x[:, 1:]), grown(y[:, 1:])
        self.length, self.width = grown(length), grown(width[1:])
        self.strength = grown(width[1:] ** 2 / (2 * length))
        self.area, self.mass = grown(_area(*_diagonals(x, y))), grown(mass[1:])
        self.centre_x, self.centre_y = x[:, 0].mean(), y[:, 0].mean()
        self.base_mass, self.radius = mass[0], width[0] / 2

    def initial(self) -> State:
        """At rest, the base upright."""
        x, y = (np.broadcast_to(v, (*v.shape[:2], *self.arms)) for v in (self.x, self.y))
        return np.full(self.arms, np.pi / 2), np.zeros(self.arms), x, y, 0 * x, 0 * y

    def step(self, state: State, action: np.ndarray) -> State:
        """One environment step; the action is (2 + 3S, arms ...)."""
        action = np.clip(action, 0.0, 1.0)
        state = (state[0] - 2 * np.pi * np.round(state[0] / (2 * np.pi)), *state[1:])
        h = SUB_STEP
        for _ in range(SUB_STEPS):
            k1 = self.derivative(state, action)
            k2 = self.derivative(_ahead(state, h / 2, k1), action)
            k3 = self.derivative(_ahead(state, h / 2, k2), action)
            k4 = self.derivative(_ahead(state, h, k3), action)
            state = _ahead(
                state, h / 6, (a + 2 * b + 2 * c + d for a, b, c, d in zip(k1, k2, k3, k4))
            )
        return state

    def derivative(self, state: State, action: np.ndarray) -> State:
        """Rates of change."""
        theta, omega, free_x, free_y, free_vx, free_vy = state
        lever_x = self.radius * self.side * np.cos(theta)
        lever_y = self.radius * self.side * np.sin(theta)
        x = np.concatenate([(self.centre_x + lever_x)[:, None], free_x], axis=1)
        y = np.concatenate([(self.centre_y + lever_y)[:, None], free_y], axis=1)
        vx = np.concatenate([(-omega * lever_y)[:, None], free_vx], axis=1)
        vy = np.concatenate([(omega * lever_x)[:, None], free_vy], axis=1)
        force_x, force_y = self._forces((x, y), (vx, vy), action[2:].reshape(-1, 3, *self.arms))
        above = (y >= self.known["surface_level"]) * self.known["gravity"]
        base_y = force_y[:, 0] - self.base_mass * above[:, 0]
        torque = self.known["torque"] * (action[0] - action[1])
        torque = torque + (lever_x * base_y - lever_y * force_x[:, 0]).sum(axis=0)
        acceleration_y = force_y[:, 1:] / self.mass - above[:, 1:]
        inertia = 2 * self.base_mass * self.radius**2
        return omega, torque / inertia, free_vx, free_vy, force_x[:, 1:] / self.mass, acceleration_y

    def _forces(self, place: Pair, v: Pair, on: np.ndarray) -> Pair:
        known, (x, y), (vx, vy) = self.known, place, v
        stiffness = known["muscle_passive"] + known["muscle_active"] * on
        along, along_v = (np.diff(x, axis=1), np.diff(y, axis=1)), [np.diff(v, axis=1) for v in v]
        pull = self.strength * np.stack([stiffness[:, 0], stiffness[:, 2]])
        pull = self._tension(along, along_v, pull, self.length, self.strength)
        across, across_v = (
            (x[1, 1:] - x[0, 1:], y[1, 1:] - y[0, 1:]),
            (vx[1] - vx[0], vy[1] - vy[0]),
        )
        across_v = across_v[0][1:], across_v[1][1:]
        pinch = self.width * stiffness[:, 1]
        pinch = self._tension(across, across_v, pinch, self.width, self.width)
        rising, falling = _diagonals(x, y)
        area = _area(rising, falling)
        excess = known["pressure"] * (np.abs(area) - self.area)
        press = np.sign(area) * np.sign(excess) * np.sqrt(np.abs(excess))
        force_x, force_y = np.zeros_like(x), np.zeros_like(y)
        for force, i, sign in ((force_x, 1, 1.0), (force_y, 0, -1.0)):
            edge = along[1 - i]
            force[:, :-1] += pull * edge
            force[:, 1:] -= pull * edge
            force[:, 1:] += np.stack([pinch * across[1 - i], -pinch * across[1 - i]])
            push = sign * press
            force[:, :-1] += np.stack([push * rising[i], -push * falling[i]])
            force[:, 1:] += np.stack([push * falling[i], -push * rising[i]])
        square = along[0] ** 2 + along[1] ** 2
        scale = 1 / (square * np.sqrt(square))
        with_edge = vx[:, 1:] * along[0] + vy[:, 1:] * along[1]
        with_edge = known["friction_tangential"] * np.abs(with_edge) * with_edge * scale
        beside = vy[:, 1:] * along[0] - vx[:, 1:] * along[1]
        beside = known["friction_perpendicular"] * np.abs(beside) * beside * scale
        force_x[:, 1:] -= with_edge * along[0] - beside * along[1]
        force_y[:, 1:] -= with_edge * along[1] + beside * along[0]
        return force_x, force_y

    def _tension(
        self,
        edge: Pair,
        rate: Iterable[np.ndarray],
        pull: np.ndarray,
        rest: np.ndarray,
        gain: np.ndarray,
    ) -> np.ndarray:
        """Force over length."""
        square = edge[0] ** 2 + edge[1] ** 2
        length = np.sqrt(square)
        spring = pull * np.maximum(length / rest - self.known["muscle_min_length"], 0.0)
        rate_x, rate_y = rate
        damping = self.known["muscle_damping"] * gain * (rate_x * edge[0] + rate_y * edge[1])
        return (spring * length + damping) / square


def _ahead(state: State, h: float, rates: Iterable[np.ndarray]) -> State:
    return tuple(value + h * rate for value, rate in zip(state, rates))


def _diagonals(x: np.ndarray, y: np.ndarray) -> tuple[Pair, Pair]:
    rising = x[0, 1:] - x[1, :-1], y[0, 1:] - y[1, :-1]
    return rising, (x[1, 1:] - x[0, :-1], y[1, 1:] - y[0, :-1])


def _area(rising: Pair, falling: Pair) -> np.ndarray:
    return (falling[0] * rising[1] - falling[1] * rising[0]) / 2
