"""Noise whose power falls with its frequency: white, pink, red, and what lies between."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PRNGKeyArray

from detpg.types import Number


class NoiseState(eqx.Module):
    """A stretch of noise of one world, and where in it the world is."""

    stretch: Float[Array, "time act"]
    index: Int[Array, ""]

    @property
    def value(self) -> Float[Array, "act"]:
        """The noise now, of standard deviation 1."""
        return self.stretch[self.index]


@dataclasses.dataclass(frozen=True)
class ColouredNoise:
    """Gaussian noise of standard deviation 1 whose power goes with frequency^-colour.

    Each action component has noise of its own, drawn for a whole stretch by its spectrum (Timmer
    and Koenig, 1995), as Eberhard et al. (ICLR 2023) explore. A new stretch begins with each
    episode, and where one is used up.

    Attributes:
        action_size: m.
        length: Steps of a stretch, an episode's where that is known.
    """

    action_size: int
    length: int

    def init(self) -> NoiseState:
        """No noise at the very first step; the stretch that follows it is the world's own."""
        stretch = jnp.zeros((self.length, self.action_size))
        return NoiseState(stretch, jnp.asarray(self.length - 1, dtype=int))

    def next(
        self, key: PRNGKeyArray, colour: Number, state: NoiseState, ended: Bool[Array, ""]
    ) -> NoiseState:
        """One step on; a new stretch where the episode or the stretch ended.

        Args:
            key: Of the new stretch.
            colour: 0 is white, 1 pink, 2 red.
            state: Of this world.
            ended: Whether the next step belongs to another episode.
        """

        def fresh() -> NoiseState:
            return NoiseState(self.draw(key, colour), jnp.zeros_like(state.index))

        def onwards() -> NoiseState:
            return NoiseState(state.stretch, state.index + 1)

        return jax.lax.cond(ended | (state.index + 1 >= self.length), fresh, onwards)

    def draw(self, key: PRNGKeyArray, colour: Number) -> Float[Array, "time act"]:
        """A stretch of noise."""
        if self.length < 2:
            return jax.random.normal(key, (self.length, self.action_size))
        num = self.length // 2 + 1
        # The slowest wave that fits stands for what is slower still, the constant too.
        frequency = jnp.maximum(jnp.arange(num, dtype=float), 1.0)[:, None]
        amplitude = frequency ** (-colour / 2)
        real, imaginary = jax.random.normal(key, (2, num, self.action_size)) * amplitude[None]
        # A constant has no phase, nor has the fastest wave of an even number of steps.
        still = jnp.zeros(num, bool).at[0].set(True).at[-1].set(self.length % 2 == 0)[:, None]
        root_two = jnp.sqrt(jnp.asarray(2.0, real.dtype))
        wave = jax.lax.complex(
            jnp.where(still, root_two * real, real),
            jnp.where(still, jnp.zeros_like(imaginary), imaginary),
        )
        noise = jnp.fft.irfft(wave, n=self.length, axis=0)
        share = jnp.where(still, jnp.full_like(amplitude, 0.5), jnp.ones_like(amplitude))
        power = jnp.sum(share * amplitude**2) * (2 / self.length) ** 2
        return noise / jnp.sqrt(power)
