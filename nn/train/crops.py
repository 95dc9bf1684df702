"""A cache of measured frames, and crops from it.

Each frame becomes two files: NAME.npy, float16 (layers, height, width), the stack of `planes.py` and behind it the
reference's light (TARGETS), mapped into memory and never read whole; and NAME.json, its scene, exposure, what it has,
and how probable a crop at each corner of a grid is to be accepted. Dull crops are rejected as by Bako et al. 2017
("Kernel-predicting convolutional networks"): the more noise and edges, of light and of normals, the more probable.
"""

import hashlib
import json
import os
from pathlib import Path

import numpy as np

import frames
from planes import LIGHTS, STACK_CHANNELS, WHERE, component, exposure, finite, layout, measure

VERSION = 1
LARGEST = 6e4  # of float16
GRID = 8  # pixels between the corners of which the probability is kept
LEAST = 0.1  # probability of the dullest crop
INTERESTING = 75  # percentile of the crops of a frame from which on every one is accepted
TRIES = 8

TARGETS, TARGET_CHANNELS = layout({f"target.{name}": 3 for name in LIGHTS})


def edges(x):
    """Root of the squared differences to the right and lower neighbours, summed over channels."""
    right = np.diff(x, axis=2, append=x[:, :, -1:])
    below = np.diff(x, axis=1, append=x[:, -1:])
    return np.sqrt((right**2 + below**2).sum(0))


def interest(stack, target, scale):
    """(height, width): how much there is to learn from a pixel."""
    exposed = scale * np.maximum(target, 0)
    noise = scale * stack[WHERE["rgb.noise"]][0] / (exposed.mean(0) + 0.05)
    return np.minimum(noise, 1) + np.minimum(edges(np.log1p(exposed)), 0.5) + 0.2 * edges(stack[WHERE["normal"]])


def acceptance(interest_map, size):
    """Probabilities of the crops whose corners are GRID pixels apart, (rows, columns)."""
    sums = np.pad(interest_map, ((1, 0), (1, 0))).cumsum(0, dtype=np.float64).cumsum(1)
    rows, columns = (np.arange(0, side - size + 1, GRID) for side in interest_map.shape)
    crops = sums[rows + size][:, columns + size] - sums[rows][:, columns + size]
    crops += sums[rows][:, columns] - sums[rows + size][:, columns]
    top = np.percentile(crops, INTERESTING)
    return np.clip(crops / top, LEAST, 1) if top > 0 else np.full(crops.shape, LEAST)


def prepare(pair, size):
    """The arrays and the description of a frame for the cache; ValueError where it is smaller than a crop."""
    noisy, reference, spp = frames.load(pair)
    stack, given = measure(noisy)
    targets = np.zeros((TARGET_CHANNELS, *stack.shape[1:]), np.float32)
    for name in LIGHTS:
        light = component(reference, name)
        if light is None:
            given.discard(name)
        else:
            targets[TARGETS[f"target.{name}"]] = light
    if min(stack.shape[1:]) < size:
        raise ValueError(f"{pair.noisy}: expected {size}x{size} pixels or more, found {stack.shape[2]}x{stack.shape[1]}")
    scale = exposure(component(noisy, "rgb"))
    probabilities = acceptance(interest(stack, targets[TARGETS["target.rgb"]], scale), size)
    everything = np.clip(finite(np.concatenate([stack, targets])), -LARGEST, LARGEST).astype(np.float16)
    description = {
        "version": VERSION, "name": pair.name, "scene": pair.scene, "spp": spp, "exposure": scale, "given": sorted(given),
        "size": size, "acceptance": probabilities.round(3).tolist(),
    }  # fmt: skip
    return everything, description


class Frame:
    def __init__(self, path, description):
        self.path, self.key = path, path.stem
        self.scene, self.name = description["scene"], description["name"]
        self.exposure, self.given = description["exposure"], frozenset(description["given"])
        self.acceptance = np.array(description["acceptance"], np.float32)
        self.pixels = np.load(path, mmap_mode="r")
        self.sides = self.pixels.shape[1:]

    def corner(self, random, size):
        """Of a crop, by rejection."""
        height, width = self.sides
        for _ in range(TRIES):
            y, x = random.integers(height - size + 1), random.integers(width - size + 1)
            rows, columns = self.acceptance.shape
            if random.random() < self.acceptance[min(y // GRID, rows - 1), min(x // GRID, columns - 1)]:
                break
        return int(y), int(x)

    def crop(self, y, x, size):
        """The stack and {light: its reference}, float32."""
        pixels = np.asarray(self.pixels[:, y : y + size, x : x + size], np.float32)
        targets = pixels[STACK_CHANNELS:]
        return pixels[:STACK_CHANNELS], {name: targets[TARGETS[f"target.{name}"]] for name in LIGHTS}


class Cache:
    """All frames below `roots` that may be trained on, prepared once into `folder` for crops of `size` pixels."""

    version, frame = VERSION, Frame

    def __init__(self, folder, roots, size, share=0.0, log=print):
        self.folder, self.roots, self.size, self.share, self.log = Path(folder), roots, size, share, log
        self.frames, self.refused = [], {}
        self.folder.mkdir(parents=True, exist_ok=True)

    def pairs(self):
        """What may be trained on."""
        return [pair for pair in frames.find(self.roots) if not frames.held_out(pair.scene, self.share)]

    def refresh(self):
        """Takes in what has been rendered since; a frame that cannot be read (yet) is tried again when it changes."""
        known = {frame.key for frame in self.frames}
        for pair in self.pairs():
            key = self.key(pair)
            if key in known or key in self.refused:
                continue
            try:
                self.frames.append(self.open(key, pair))
            except (OSError, ValueError) as error:
                self.refused[key] = str(error)
                self.log(f"not used: {error}")
        self.frames.sort(key=lambda frame: (frame.scene, frame.name, frame.key))

    def restrict(self, keys):
        """Goes back to the frames of an earlier moment, as far as they are still there."""
        self.frames = [frame for frame in self.frames if frame.key in keys]

    def key(self, pair):
        stamps = [(file.stat().st_size, file.stat().st_mtime_ns) for file in (pair.noisy, pair.reference)]
        return hashlib.sha256(repr((self.version, self.size, pair.scene, pair.name, stamps)).encode()).hexdigest()[:24]

    def open(self, key, pair):
        path = self.folder / f"{key}.npy"
        described = path.with_suffix(".json")
        if not described.exists():
            pixels, description = self.prepare(pair)
            replace(path, lambda file: np.save(file, pixels))
            replace(described, lambda file: file.write(json.dumps(description).encode()))
        return self.frame(path, json.loads(described.read_text()))

    def prepare(self, pair):
        return prepare(pair, self.size)

    def scenes(self):
        result = {}
        for frame in self.frames:
            result.setdefault(frame.scene, []).append(frame)
        return result


def replace(path, write):
    """Writes a file beside its place and moves it there when it is complete."""
    partial = path.with_name(path.name + ".partial")
    with open(partial, "wb") as file:
        write(file)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
