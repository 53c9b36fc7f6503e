"""Runs a controller exported as JSON with NumPy alone; copy this file, it needs nothing else."""

import json

import numpy as np

UNITS = {
    "linear": lambda x: x,
    "tanh": np.tanh,
    "sigmoid": lambda x: (1 + np.tanh(x / 2)) / 2,
    "relu": lambda x: np.maximum(x, 0),
}


def features(x, s):
    """The features of a batch of observations, [N, n]."""
    if x["kind"] == "quadratic":
        one = np.concatenate([np.ones_like(s[:, :1]), s], 1)
        i, j = np.triu_indices(one.shape[1])
        return one[:, i] * one[:, j]
    # Tiles: where the observation lies in each tiling, and the weight of that tile.
    grid, starts, density = (np.asarray(x[k], np.float32) for k in ("grid", "starts", "density"))
    place = (s[:, None] - starts) * density
    inside = np.clip(place, np.float32(x["margin"]), grid - np.float32(x["margin"]))
    place = np.nan_to_num(np.floor(np.where(x["wrapped"], place, inside)).astype(float))
    tile = np.clip(place, -(2**31), 2**31 - 1).astype(np.int64) % np.asarray(x["grid"])
    index = np.broadcast_to(np.arange(len(starts)), tile.shape[:2])
    if x["memory"] is None:
        index = index * np.prod(x["grid"]) + tile @ np.cumprod([1, *x["grid"][:-1]])
    else:
        for k in range(len(x["grid"])):
            index = (index * 0x85EBCA6B + tile[:, :, k] + 1) % 2**32
            index = (index ^ (index >> 15)) * 0xC2B2AE35 % 2**32
            index = index ^ (index >> 13)
        index = index % x["memory"]
    found = np.zeros((len(s), x["size"]), np.float32)
    np.add.at(found, (np.arange(len(s))[:, None], index), 1)
    found[:, x["size"] - x["bias"] :] = 1
    return found


def policy(mu, s):
    """The action in units of the box, [N, m]."""
    if mu["kind"] == "mlp":
        for layer in mu["layers"]:
            weight, bias = (np.asarray(layer[k], np.float32) for k in ("weight", "bias"))
            s = UNITS[layer["unit"]](s @ weight.T + bias)
        return s
    theta = np.asarray(mu["theta"], np.float32)
    if mu["kind"] == "constant":
        return np.broadcast_to(theta, (len(s), len(theta)))
    return (s if mu["kind"] == "linear" else features(mu["features"], s)) @ theta.T


def load(path):
    """The controller in a file: a function from observations [N, d] to actions [N, m]."""
    with open(path) as file:  # noqa: PTH123
        kept = json.load(file)
    scale, normaliser = kept["scaling"], kept["normaliser"]
    centre, half = (np.asarray(scale[k], np.float32) for k in ("centre", "half_range"))
    own, world = (_box(scale[name]) for name in ("policy_bounds", "action_bounds"))

    def run(observations):
        s = np.asarray(observations, np.float32)
        s = np.where(np.abs(s) < np.finfo(np.float32).tiny, np.float32(0), s)
        if normaliser:
            mean, deviation = (np.asarray(normaliser[k], np.float32) for k in ("mean", "deviation"))
            s = np.clip((s - mean) / deviation, -normaliser["most"], normaliser["most"])
        action = np.clip(policy(kept["policy"], s), own[0], own[1])
        return np.clip(centre + half * action, world[0], world[1])

    return run


def _box(bounds):
    """Lower and upper bound; null stands for none."""
    ends = zip(("low", "high"), (-np.inf, np.inf))
    filled = ([none if x is None else x for x in bounds[end]] for end, none in ends)
    return [np.asarray(numbers, np.float32) for numbers in filled]
