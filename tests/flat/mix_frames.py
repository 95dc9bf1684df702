#!/usr/bin/env python3
"""Makes mix_planes.safetensors: small frames with candidates, and what training makes of them.

    PYTHONPATH=nn/train:tests/flat tests/flat/mix_frames.py tests/flat/mix_planes.safetensors

Tensors are CASE/in/CHANNEL, CASE/candidate/BASE.CHANNEL as `fathom progressive --candidates` names them, and CASE/shared and
CASE/own/BASE, the planes.
"""

import sys

import numpy as np

import mix_planes
from neural_planes import frame, without
from planes import component, exposure
from weights import write_tensors

SPP = 8


def candidates(random, channels):
    """Two of them, bright and dark, sure and unsure."""
    result, shape = {}, channels["R"].shape
    for base, size in (("nlm", 1), ("oidn", 30)):
        for c in "RGB":
            result[f"{base}.{c}"] = channels[c] + size * random.normal(0, 0.1, shape)
            for what in ("error", "variance", "covariance", "spread"):
                result[f"{base}.{what}.{c}"] = size * random.uniform(0, 1, shape) ** 6
        result[f"{base}.gate"] = random.uniform(0, 1, shape)
    return {name: x.astype(np.float32) for name, x in result.items()}


def main(path):
    random = np.random.default_rng(1)
    full = frame(random, 6, 10)
    counted = {**full, "samples": random.integers(1, 9, full["R"].shape).astype(np.float32)}
    cases = {"full": full, "samples": counted, "light": without(full, "half", "A", "albedo", "N.", "diffuse", "Z")}
    tensors = {}
    for case, channels in cases.items():
        made, scale = candidates(random, channels), exposure(component(channels, "rgb"))
        tensors[f"{case}/shared"] = mix_planes.shared(channels, SPP, scale)
        for base in ("nlm", "oidn"):
            tensors[f"{case}/own/{base}"] = mix_planes.own(channels, SPP, made, base, scale)
        tensors.update({f"{case}/in/{name}": x for name, x in channels.items()})
        tensors.update({f"{case}/candidate/{name}": x for name, x in made.items()})
    write_tensors(path, tensors)


if __name__ == "__main__":
    main(sys.argv[1])
