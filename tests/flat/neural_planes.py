#!/usr/bin/env python3
"""Makes neural_planes.safetensors: small frames, and what training makes of them.

    PYTHONPATH=nn/train tests/flat/neural_planes.py tests/flat/neural_planes.safetensors

Tensors are CASE/in/CHANNEL, and for each light of the frame CASE/LIGHT/planes, /colour and /divisor.
"""

import sys

import numpy as np

from planes import LIGHTS, component, exposure, light, measure, planes
from weights import write_tensors


def frame(random, height, width):
    """A frame with all channels, empty in a corner, bright enough to reach what limits the planes."""
    def noise(low, high):
        return random.uniform(low, high, (height, width)).astype(np.float32)

    empty = np.zeros((height, width), bool)
    empty[:2, :3] = True
    channels = {"A": noise(0.5, 1), "Z": noise(1, 30)}
    for half in ("half0.", "half1."):
        for name in ("diffuse", "specular"):
            for c in "RGB":
                channels[f"{half}{name}.{c}"] = noise(0, 1) ** 4 * 20
    for c in "RGB":
        for name in ("diffuse", "specular"):
            channels[f"{name}.{c}"] = (channels[f"half0.{name}.{c}"] + channels[f"half1.{name}.{c}"]) / 2
            channels[f"variance.{name}.{c}"] = noise(0, 2) ** 8
        channels[c] = channels[f"diffuse.{c}"] + channels[f"specular.{c}"]
        channels[f"variance.{c}"] = noise(0, 2) ** 4
        channels[f"albedo.{c}"] = noise(-0.1, 1.2)
        channels[f"variance.albedo.{c}"] = noise(0, 1.5) ** 2
    for c in "XYZ":
        channels[f"N.{c}"] = noise(-1.2, 1.2)
        channels[f"variance.N.{c}"] = noise(0, 1.5) ** 2
    channels["variance.Z"] = noise(0, 20) ** 2
    for name, values in channels.items():
        values[empty] = 0
    channels["diffuse.G"][height - 1, 4] = -1  # filters that sharpen leave such
    return channels


def without(channels, *beginnings):
    return {name: x for name, x in channels.items() if not name.startswith(beginnings)}


def main(path):
    random = np.random.default_rng(1)
    full = frame(random, 6, 10)
    cases = {
        "full": full,
        "whole-variance": without(full, "variance.diffuse", "variance.specular", "half"),
        "halves": without(full, "variance", "Z"),
        "no-albedo": without(full, "albedo", "variance.albedo", "half"),
        "light": without(full, "variance", "half", "A", "albedo", "N.", "diffuse", "Z"),
        "black": {name: 0 * x for name, x in frame(random, 3, 5).items()},
    }
    tensors = {}
    for case, channels in cases.items():
        scale = exposure(light(channels, ""))
        stack, given = measure(channels)
        for name in (x for x in LIGHTS if component(channels, x) is not None):
            result, colour, divisor = planes(stack, given, name, scale)
            for what, values in (("planes", result), ("colour", colour), ("divisor", divisor)):
                tensors[f"{case}/{name}/{what}"] = values
        tensors.update({f"{case}/in/{name}": x for name, x in channels.items()})
    write_tensors(path, tensors)


if __name__ == "__main__":
    main(sys.argv[1])
