"""The octopus arm once more, in plain NumPy and one node at a time.

Written from a description of the public simulators' forces, not from `detpg`: it shares neither
formula nor order with it, is slow, and serves as an oracle for any parameters.
"""

import numpy as np

SUB_STEPS, SUB_STEP = 25, 0.2


class ReferenceArm:
    """Forces and Runge-Kutta steps on the flat vector of state."""

    def __init__(self, parameters):
        for name, value in vars(parameters).items():
            setattr(self, name, np.asarray(value, dtype=np.float64))
        self.segments = len(self.mass) - 1
        self.centre = (self.upper[0] + self.lower[0]) / 2
        self.radius = np.linalg.norm(self.upper[0] - self.lower[0]) / 2
        self.areas = [self._area(*self._corners(self.upper, self.lower, k)) for k in self._all()]

    def _all(self):
        return range(self.segments)

    @staticmethod
    def _corners(upper, lower, k):
        return upper[k], upper[k + 1], lower[k + 1], lower[k]

    @staticmethod
    def _area(near_upper, far_upper, far_lower, near_lower):
        """Half the cross product of the diagonals, positive at rest."""
        falling, rising = far_lower - near_upper, far_upper - near_lower
        return (falling[0] * rising[1] - falling[1] * rising[0]) / 2

    def _unpack(self, state):
        theta, omega = state[:2]
        lever = self.radius * np.array([np.cos(theta), np.sin(theta)])
        turning = omega * np.array([-lever[1], lever[0]])
        sides = state[2:].reshape(2, self.segments, 4)
        places = [
            np.vstack([self.centre + s * lever, sides[i, :, :2]]) for i, s in ((0, 1), (1, -1))
        ]
        speeds = [np.vstack([s * turning, sides[i, :, 2:]]) for i, s in ((0, 1), (1, -1))]
        return places, speeds

    def _muscle(self, forces, ends, places, speeds, rest, gain, activation):
        (i, j), (k, m) = ends
        edge = places[k][m] - places[i][j]
        length = np.linalg.norm(edge)
        direction = edge / length
        force = 0.0
        if length / rest > self.muscle_min_length:
            stiffness = self.muscle_active * min(max(activation, 0.0), 1.0) + self.muscle_passive
            force += gain * stiffness * (length / rest - self.muscle_min_length)
        closing = np.dot(speeds[i][j] - speeds[k][m], direction)
        force -= gain * self.muscle_damping * closing
        forces[i][j] += force * direction
        forces[k][m] -= force * direction

    def _forces(self, places, speeds, action):
        forces = [np.zeros((self.segments + 1, 2)) for _ in range(2)]
        rest = (self.upper, self.lower)
        for k in self._all():
            width = np.linalg.norm(self.upper[k + 1] - self.lower[k + 1])
            dorsal, transversal, ventral = action[2 + 3 * k : 5 + 3 * k]
            for i, activation in ((0, dorsal), (1, ventral)):
                length = np.linalg.norm(rest[i][k + 1] - rest[i][k])
                ends = ((i, k), (i, k + 1))
                gain = width**2 / length / 2
                self._muscle(forces, ends, places, speeds, length, gain, activation)
            ends = ((0, k + 1), (1, k + 1))
            self._muscle(forces, ends, places, speeds, width, width, transversal)
            self._press(forces, places, k)
            for i in (0, 1):
                axis = places[i][k + 1] - places[i][k]
                axis = axis / np.linalg.norm(axis)
                v = speeds[i][k + 1]
                along = np.dot(v, axis) * axis
                across = v - along
                forces[i][k + 1] -= self.friction_tangential * np.linalg.norm(along) * along
                forces[i][k + 1] -= self.friction_perpendicular * np.linalg.norm(across) * across
        for i in (0, 1):
            for j, mass in enumerate(self.mass):
                if places[i][j][1] >= self.surface_level:
                    forces[i][j][1] -= mass * self.gravity
        return forces

    def _press(self, forces, places, k):
        where = ((0, k), (0, k + 1), (1, k + 1), (1, k))
        corners = [places[i][j] for i, j in where]
        area = self._area(*corners)
        excess = self.pressure * (abs(area) - abs(self.areas[k]))
        push = np.sign(area) * np.sign(excess) * np.sqrt(abs(excess))
        for n, (i, j) in enumerate(where):
            across = corners[(n + 1) % 4] - corners[n - 1]
            forces[i][j] += push * np.array([across[1], -across[0]])

    def derivative(self, state, action):
        places, speeds = self._unpack(state)
        forces = self._forces(places, speeds, action)
        torque = self.torque * (action[0] - action[1])
        for i in (0, 1):
            lever = places[i][0] - self.centre
            torque += lever[0] * forces[i][0][1] - lever[1] * forces[i][0][0]
        rates = [state[1], torque / (2 * self.mass[0] * self.radius**2)]
        for i in (0, 1):
            for j in range(1, self.segments + 1):
                rates += [*speeds[i][j], *(forces[i][j] / self.mass[j])]
        return np.array(rates)

    def sub_step(self, state, action):
        h = SUB_STEP
        k1 = self.derivative(state, action)
        k2 = self.derivative(state + h / 2 * k1, action)
        k3 = self.derivative(state + h / 2 * k2, action)
        k4 = self.derivative(state + h * k3, action)
        return state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def step(self, state, action):
        state = state.copy()
        state[0] = (state[0] + np.pi) % (2 * np.pi) - np.pi
        for _ in range(SUB_STEPS):
            state = self.sub_step(state, action)
        return state
