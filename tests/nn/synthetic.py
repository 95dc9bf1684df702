"""Procedural frames with noise, in files as a renderer writes them: checkered cards before a wall, lit from a side."""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "nn" / "train"))

from exr import write  # noqa: E402

SPP = 4


def scene(random, width, height):
    """{layer: (channels, height, width)} without noise."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    layers = {"albedo": np.empty((3, height, width)), "N": np.empty((3, height, width)), "Z": np.full((height, width), 9.0)}
    layers["albedo"][:], layers["N"][:] = 0.7, np.array([0, 0, 1])[:, None, None]
    for _ in range(6):
        angle, period = random.uniform(0, np.pi), random.uniform(6, 14)
        u = (x - random.uniform(0, width)) * np.cos(angle) + (y - random.uniform(0, height)) * np.sin(angle)
        v = (y - random.uniform(0, height)) * np.cos(angle) - (x - random.uniform(0, width)) * np.sin(angle)
        card = (np.abs(u) < random.uniform(8, 20)) & (np.abs(v) < random.uniform(8, 20))
        checks = (np.floor(u / period) + np.floor(v / period)) % 2 > 0
        normal = random.normal(size=3) + [0, 0, 1.5]
        for layer, value in (("albedo", random.uniform(0.1, 0.9, 3)), ("N", normal / np.linalg.norm(normal))):
            layers[layer][:, card] = value[:, None]
        layers["albedo"][:, card & checks] *= 0.2
        layers["Z"][card] = random.uniform(2, 8)
    direction = random.normal(size=3) + [0, 0, 2]
    shade = np.maximum((layers["N"] * (direction / np.linalg.norm(direction))[:, None, None]).sum(0), 0)
    falloff = 1.5 / (1 + ((x - width / 2) ** 2 + (y - height / 2) ** 2) / width**2)
    layers["diffuse"] = layers["albedo"] * (shade * falloff + 0.1)
    layers["specular"] = np.repeat(0.8 * shade[None] ** 20 * falloff, 3, 0)
    return layers


def channels_of(name, values, letters="RGB"):
    return {f"{name}.{letter}": value for letter, value in zip(letters, values)}


def noisy(random, layers, spp):
    """The channels of a render: halves of half the samples each, and the variance of their mean."""
    channels = {"Z": layers["Z"], "A": np.ones_like(layers["Z"])}
    for name in ("diffuse", "specular"):
        halves = [layers[name] * random.gamma(spp / 2, 2 / spp, layers["Z"].shape) for _ in range(2)]
        layers = {**layers, name: (halves[0] + halves[1]) / 2}
        channels.update(channels_of(f"half0.{name}", halves[0]) | channels_of(f"half1.{name}", halves[1]))
        channels.update(channels_of(f"variance.{name}", layers[name] ** 2 / spp))
    whole = layers["diffuse"] + layers["specular"]
    channels.update(zip("RGB", whole))
    channels.update(channels_of("variance", whole**2 * 2 / SPP))
    return channels | features(layers)


def features(layers):
    result = channels_of("N", layers["N"], "XYZ")
    for name in ("albedo", "diffuse", "specular"):
        result.update(channels_of(name, layers[name]))
    return result


def write_frames(folder, scenes=("cards", "walls", "coffee"), views=2, width=72, height=56, seed=3):
    """Two noisy frames of each view, and its reference, in a folder per scene; `coffee` is always held out."""
    for number, name in enumerate(scenes):
        (folder / name).mkdir(parents=True, exist_ok=True)
        for view in range(views):
            random = np.random.default_rng([seed, number, view])
            layers = scene(random, width, height)
            whole = layers["diffuse"] + layers["specular"]
            clean = features(layers) | dict(zip("RGB", whole)) | channels_of("variance", 0 * whole)
            write(folder / name / f"view{view}.ref.exr", clean)
            for spp in (SPP, 2 * SPP):
                write(folder / name / f"view{view}.{spp}.flat.exr", noisy(random, layers, spp))
