#!/usr/bin/env python3
"""Writes a small layered network and what it makes of a small deep frame, for other implementations to be compared with.

    golden_layers.py WEIGHTS.safetensors OUT.safetensors [--width 16] [--size 26x19]

WEIGHTS is read where it exists; else a network with random weights is written there. The frame has pixels without samples, with
one and with many, and some whose alphas do not add up to 1. OUT's tensors, S samples in the order of the pixels, row after row, front to back:
  counts (height, width): samples of each pixel
  A, Z, coc, lens.U, ..., diffuse.R, ...  (S): channels as in a deep file, premultiplied
  exposure, depth (1): the scale of the light, and the mean depth
  inputs (S, 20), weight (S), light (S, 6): what the network reads of them; diffuse light, divided, and specular light times the exposure
  sample_inputs (S, 20): the same without variance.* and samples, of SPP camera samples per pixel
  partition{L} (S, L); radiance{L} (L, 3, height, width), opacity{L} and depth{L} (L, height, width): of the layers, premultiplied
  colour{L} (3, height, width), alpha{L} (height, width): the result. L is 1, 2 and 4; all light is times the exposure. The lights
  are denoised apart.
"""

import argparse
from pathlib import Path

import numpy as np
import torch

import samples
from layers_model import LAYERS, Layered, assembled, together
from weights import load_model, save_model, write_tensors

MOST = 9  # samples of a pixel
SPP = 8
STRONG = 20  # factor on the last layers of partition and kernels


def random_frame(random, width, height):
    """Counts and channels of a deep frame of bins: a near and a far surface, and nothing on the right."""
    counts = random.integers(0, 3, (height, width)) + (random.random((height, width)) < 0.2) * random.integers(1, MOST - 1, (height, width))
    counts[:, -width // 4 :] = 0
    counts[0, 0], counts[1, 1], counts[2, 2] = 0, 1, MOST
    total = int(counts.sum())
    pixel = np.repeat(np.arange(counts.size), counts.ravel())
    z = np.where(random.random(total) < 0.4, 2.0, 6.0) + random.random(total)
    z = z[np.lexsort((z, pixel))]
    last = np.append(np.diff(pixel) > 0, True)
    channels = {"A": np.where(last & (random.random(total) < 0.7), 1, random.uniform(0.05, 0.9, total)), "Z": z}
    for name, letters, low, high in (("diffuse", "RGB", 0, 1.5), ("specular", "RGB", 0, 1.5), ("albedo", "RGB", 0, 1), ("N", "XYZ", -1, 1)):
        for letter in letters:
            channels[f"{name}.{letter}"] = random.uniform(low, high, total) ** (2 if low == 0 else 1) * channels["A"]
    for letter in "RGB":
        channels[letter] = channels[f"diffuse.{letter}"] + channels[f"specular.{letter}"]
        for name in ("diffuse", "specular"):
            channels[f"variance.{name}.{letter}"] = random.exponential(0.02, total)
    channels["samples"] = random.integers(1, 30, total).astype(np.float64)
    channels["coc"] = random.uniform(0, 9, total)
    channels["lens.U"], channels["lens.V"] = random.random((2, total))
    return counts, {name: x.astype(np.float32) for name, x in channels.items()}


def inputs_of(deep, scale, depth):
    """The inputs of both lights, each with what is its own."""
    diffuse, specular = (samples.listed(x, scale, depth)[0] for x in samples.lights_apart(deep))
    return np.where(np.isin(np.arange(diffuse.shape[1]), (3, 4, 5, 18)), specular, diffuse)


def golden(model, width, height, seed=7):
    counts, channels = random_frame(np.random.default_rng(seed), width, height)
    deep = samples.measure(counts, channels)
    scale, depth = samples.exposure_of(deep), samples.mean_depth(deep)
    lights = [assembled([samples.listed(x, scale, depth)], samples.padded(deep.shape)) for x in samples.lights_apart(deep)]
    tensors = {"counts": counts, "exposure": [scale], "depth": [depth], **channels}
    tensors.update(inputs=inputs_of(deep, scale, depth), weight=lights[0].weight.numpy(), light=np.concatenate([x.light.numpy() for x in lights], 1))
    plain = {name: x for name, x in channels.items() if name != "samples" and not name.startswith("variance.")}
    tensors["sample_inputs"] = inputs_of(samples.measure(counts, plain, SPP), scale, depth)
    for k in LAYERS:
        with torch.no_grad():
            first = model.result(lights[0], k)
            result = together([first, model.result(lights[1], k, first.partition)])
        tensors[f"partition{k}"] = result.partition.numpy()
        crop = {"radiance": result.radiance[:, 0], "opacity": result.opacity[:, 0, 0], "depth": result.depth[:, 0, 0]}
        crop.update(colour=result.colour[0], alpha=result.alpha[0, 0])
        tensors.update({f"{name}{k}": x[..., :height, :width].numpy() for name, x in crop.items()})
    return tensors


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--width", type=int, default=16, help="of the random network")
    parser.add_argument("--size", default="26x19", help="width x height, in pixels")
    options = parser.parse_args(arguments)
    width, height = map(int, options.size.split("x"))
    if not options.weights.exists():
        torch.manual_seed(5)
        model = Layered(options.width)
        with torch.no_grad():  # so that no bias is 0, some samples go to one layer alone, and kernels have peaks
            for name, x in model.named_parameters():
                x.add_(0.1 * torch.randn_like(x)) if name.endswith("bias") else x.mul_(STRONG if name.endswith(".2.weight") else 1)
        save_model(options.weights, model, {"name": "random"})
    write_tensors(options.out, golden(load_model(options.weights, Layered), width, height))


if __name__ == "__main__":
    main()
