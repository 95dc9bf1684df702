"""A cache of camera samples, and crops from it.

As `crops.py`, of files of samples: NAME.npy, float16 (height, width, n), has the samples of a pixel behind one another, front to back, in the
first columns of samples.py (depth 0: none), and behind them the reference's light of all LIGHTS (as much as it has), alpha, and whether these
count: samples know nothing of an environment that is seen where nothing was hit.
"""

import numpy as np

import crops
import frames
import samples
from clusters import PHYSICAL
from exr import read, read_deep
from planes import LIGHTS, component

VERSION = 3
TARGETS = 3 * len(LIGHTS) + 2  # lights, alpha, counts
SEVERAL = 0.3  # interest of a pixel that sees more than one depth
APART = 1.03  # ratio of depths that counts as two
HELD_FRAMES = ("staircase2",)  # the shared render of a scene that others are trained on


def held_out(pair, share):
    return pair.name in HELD_FRAMES or frames.held_out(pair.scene, share)


def load(pair):
    """The list of samples, the attributes, and the reference's channels."""
    counts, channels, attributes = read_deep(pair.noisy)
    reference, _ = read(pair.reference)
    if counts.shape != reference["R"].shape:
        raise ValueError(f"{pair.noisy}: expected {reference['R'].shape} pixels, found {counts.shape}")
    if "fathom:spp" not in attributes or "fathom:ppuScale" not in attributes:
        raise ValueError(f"{pair.noisy}: expected fathom:spp and fathom:ppuScale, found {attributes}")
    return samples.measure(counts, channels, attributes["fathom:spp"]), attributes, reference


def stacked(deep, spp):
    """(height, width, spp, PHYSICAL): the samples of a pixel, the nearest first."""
    order = np.arange(len(deep.pixel)) - np.searchsorted(deep.pixel, deep.pixel)
    result = np.zeros((deep.shape[0] * deep.shape[1], spp, PHYSICAL), np.float32)
    result[deep.pixel, order] = deep.values[:, :PHYSICAL]
    return result.reshape(*deep.shape, spp, PHYSICAL)


def several(z):
    """Where (..., samples) see more than one depth."""
    near = np.where(z > 0, z, np.inf).min(-1)
    return (z.max(-1) > APART * near) & np.isfinite(near)


def counted(light, alpha):
    """Where a reference can be reached: everywhere if nothing is seen where nothing was hit, else where all was hit."""
    empty = alpha <= 0
    dark = empty.any() and not light[:, empty].any()
    return np.ones_like(alpha) if dark else (alpha >= 1 - 1e-6).astype(np.float32)


def prepare(pair, size):
    deep, attributes, reference = load(pair)
    if min(deep.shape) < size:
        raise ValueError(f"{pair.noisy}: expected {size}x{size} pixels or more, found {deep.shape[1]}x{deep.shape[0]}")
    spp = int(attributes["fathom:spp"])
    stack, light = stacked(deep, spp), component(reference, "rgb")
    alpha = np.asarray(reference.get("A", np.ones(deep.shape)), np.float32)
    counts = counted(light, alpha)
    scale = samples.exposure_of(deep)
    noisy = samples.flattened(deep, samples.light_of(deep.values))
    exposed = scale * np.maximum(light, 0)
    interest = np.minimum(scale * np.abs(noisy - light).mean(0) / (exposed.mean(0) + 0.05), 1)
    interest += np.minimum(crops.edges(np.log1p(exposed)), 0.5) + SEVERAL * several(stack[..., samples.WHERE["depth"].start])
    probabilities = crops.acceptance(interest * counts, size)
    parts = [component(reference, name) for name in LIGHTS[1:]]
    apart = all(x is not None for x in parts)
    lights = np.concatenate([light, *(parts if apart else 2 * [np.zeros_like(light)])]).transpose(1, 2, 0)
    pixels = np.concatenate([stack.reshape(*deep.shape, -1), lights, alpha[..., None], counts[..., None]], 2)
    description = {
        "version": VERSION, "name": pair.name, "scene": pair.scene, "spp": spp, "exposure": scale, "depth": samples.mean_depth(deep),
        "scale": float(attributes["fathom:ppuScale"]), "given": sorted(deep.given), "apart": apart, "size": size, "acceptance": probabilities.round(3).tolist(),
    }  # fmt: skip
    return np.clip(pixels, -crops.LARGEST, crops.LARGEST).astype(np.float16), description


class Frame(crops.Frame):
    def __init__(self, path, description):
        super().__init__(path, description)
        self.spp, self.depth, self.scale = description["spp"], description["depth"], description["scale"]
        self.apart = description["apart"]  # whether the reference has diffuse and specular light
        self.sides = self.pixels.shape[:2]

    def crop(self, y, x, size):
        """(size, size, spp, PHYSICAL) samples, float16, and (size, size, TARGETS), float32."""
        pixels = np.asarray(self.pixels[y : y + size, x : x + size])
        return pixels[..., :-TARGETS].reshape(size, size, self.spp, PHYSICAL), pixels[..., -TARGETS:].astype(np.float32)


class Cache(crops.Cache):
    version, frame = ("layers", VERSION), Frame

    def pairs(self):
        return [pair for pair in frames.find(self.roots, frames.SAMPLES) if not held_out(pair, self.share)]

    def prepare(self, pair):
        return prepare(pair, self.size)
