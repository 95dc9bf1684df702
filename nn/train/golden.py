#!/usr/bin/env python3
"""Writes what the network makes of a random input, for other implementations to be compared with.

    golden.py WEIGHTS OUT.safetensors [--size 40x24]

The file's tensors, (channels, height, width): `input`, the 24 planes; `colour`, linear light times the exposure; and
`output1`, `output2` and `output4`, the denoised colour with K = 1, 2 and 4.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

from blocks import statistics
from model import COMPONENTS, INPUTS, denoised
from weights import load_model, write_tensors


def golden(model, width, height, seed=7):
    random = np.random.default_rng(seed)
    colour = random.exponential(0.5, (3, height, width)).astype(np.float32)
    inputs = random.uniform(-1, 1, (INPUTS, height, width)).astype(np.float32)
    inputs[:3] = np.log1p(colour)
    tensors = {"input": inputs, "colour": colour, "statistics": statistics(inputs)}
    with torch.no_grad():
        for k in COMPONENTS:
            result = denoised(model, torch.from_numpy(inputs)[None], torch.from_numpy(colour)[None], k)
            tensors[f"output{k}"] = result[0].numpy()
    return tensors


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", default="40x24", help="width x height, in pixels")
    options = parser.parse_args(arguments)
    width, height = map(int, options.size.split("x"))
    write_tensors(options.out, golden(load_model(options.weights), width, height))


if __name__ == "__main__":
    main()
