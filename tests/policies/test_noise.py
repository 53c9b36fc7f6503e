"""Coloured noise: its width, its spectrum, and when it begins anew."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from detpg.policies.noise import ColouredNoise

RUNS = 2_000


@pytest.mark.parametrize("length", [1, 2, 7, 64])
def test_it_has_deviation_1_in_every_component(length):
    noise = ColouredNoise(3, length)
    drawn = jax.jit(jax.vmap(noise.draw, in_axes=(0, None)))
    stretches = np.asarray(drawn(jax.random.split(jax.random.key(0), RUNS), jnp.asarray(1.0)))
    # Pink noise is one slow wave for the most part: a few independent numbers in each stretch.
    squares = np.mean(stretches**2, axis=(0, 1))
    np.testing.assert_allclose(squares, 1.0, atol=4.5 * np.sqrt(2 / RUNS))


@pytest.mark.parametrize("colour", [0.0, 1.0, 2.0])
def test_its_power_falls_with_the_frequency_to_the_power_of_its_colour(colour):
    noise = ColouredNoise(1, 256)
    drawn = jax.jit(jax.vmap(noise.draw, in_axes=(0, None)))
    stretches = np.asarray(drawn(jax.random.split(jax.random.key(1), RUNS), jnp.asarray(colour)))
    power = np.mean(np.abs(np.fft.rfft(stretches[..., 0], axis=1)) ** 2, axis=0)[1:-1]
    slope = np.polyfit(np.log(np.arange(1, 128)), np.log(power), 1)[0]
    # Each power is known to 1/sqrt(RUNS); a line through 127 of them, much better than that.
    assert slope == pytest.approx(-colour, abs=0.03)


def test_components_are_independent():
    stretches = np.asarray(
        jax.vmap(ColouredNoise(2, 64).draw, in_axes=(0, None))(
            jax.random.split(jax.random.key(2), RUNS), jnp.asarray(1.0)
        )
    )
    together = np.mean(stretches[..., 0] * stretches[..., 1], axis=1)
    assert abs(together.mean()) < 4.5 * together.std() / np.sqrt(RUNS)


def test_a_stretch_is_walked_through_and_begins_anew_with_an_episode():
    noise = ColouredNoise(1, 3)
    onwards = jax.jit(noise.next)
    colour, going, ended = jnp.asarray(1.0), jnp.asarray(False), jnp.asarray(True)
    keys = jax.random.split(jax.random.key(3), 5)
    state = onwards(keys[0], colour, noise.init(), going)  # the first stretch
    drawn = np.asarray(noise.draw(keys[0], colour))
    seen = [np.asarray(state.value)]
    for key in keys[1:3]:
        state = onwards(key, colour, state, going)
        seen.append(np.asarray(state.value))
    np.testing.assert_allclose(seen, drawn, rtol=1e-5, atol=1e-6)
    used_up = onwards(keys[3], colour, state, going)
    np.testing.assert_allclose(
        np.asarray(used_up.stretch), np.asarray(noise.draw(keys[3], colour)), rtol=1e-5
    )
    anew = onwards(keys[4], colour, used_up, ended)
    assert int(anew.index) == 0
    np.testing.assert_allclose(
        np.asarray(anew.stretch), np.asarray(noise.draw(keys[4], colour)), rtol=1e-5
    )


def test_worlds_side_by_side_have_noise_of_their_own():
    noise = ColouredNoise(2, 8)
    states = jax.tree.map(lambda leaf: jnp.stack([leaf] * 3), noise.init())
    step = jax.jit(jax.vmap(noise.next, in_axes=(0, None, 0, 0)))
    states = step(
        jax.random.split(jax.random.key(4), 3), jnp.asarray(1.0), states, jnp.zeros(3, dtype=bool)
    )
    values = np.asarray(jax.vmap(lambda s: s.value)(states))
    assert len(np.unique(values)) == 6
