"""Variations of a crop: exposure, flips, colours, patterns, missing features, and which component of the light is denoised.

All that depends on the exposure is computed behind it, by `planes.planes`.
"""

import numpy as np

from planes import LIGHTS, WHERE, planes

STOPS = 2.0  # the exposure is the rule's times 2^-STOPS to 2^STOPS
TURNED = 0.5  # share of crops whose normals are turned to other axes of the world
SHARES = {"diffuse": 0.375, "specular": 0.375, "rgb": 0.25}
FAINT = 0.01  # a component with less of the light than this teaches nothing

# How often each feature is taken away, with all that is known of its noise.
MISSING = {
    ("albedo", "albedo.noise"): 0.1,
    ("normal", "normal.noise"): 0.1,
    ("depth", "depth.noise"): 0.1,
    ("albedo.noise", "normal.noise", "depth.noise"): 0.1,
    tuple(f"{name}.{what}" for name in LIGHTS for what in ("noise", "root")): 0.1,
    tuple(f"{name}.halves" for name in LIGHTS): 0.2,
    ("alpha",): 0.1,
}
BARE = 0.05  # share of crops with the colour alone

# Few renders show hair, cloth or engraving, and a network that has seen none takes them for noise. So light is multiplied by fine
# streaks: in so many crops, with logarithms of so large a deviation; in some of them albedo and normals show these, too.
PATTERNED, CONTRAST = 0.35, (0.2, 0.9)
SHOWN = {"albedo": 0.5, "normal": 0.5}
LENGTHS = (1, 14)  # of streaks, pixels


def turned_normals(random, flips, transposed):
    """An orthogonal map that goes with the turns of the picture, as (axes, signs)."""
    axes, signs = [0, 1, 2], np.array([-1.0 if flips[1] else 1.0, -1.0 if flips[0] else 1.0, 1.0], np.float32)
    if transposed:
        axes, signs = [1, 0, 2], signs[[1, 0, 2]]
    if random.random() < TURNED:
        order = random.permutation(3)
        axes, signs = [axes[i] for i in order], signs[order] * random.choice([-1.0, 1.0], 3).astype(np.float32)
    return axes, signs


def turn(pixels, flips, transposed):
    """Of (channels, height, width): upside down, left to right, then across the diagonal."""
    pixels = pixels[:, :: -1 if flips[0] else 1, :: -1 if flips[1] else 1]
    return pixels.transpose(0, 2, 1) if transposed else pixels


def streaks(random, height, width):
    """Noise of mean 0 and deviation 1, (height, width), drawn out along one direction, which may bend."""
    noise = random.standard_normal((height, width)).astype(np.float32)
    angle = random.uniform(0, np.pi) + random.uniform(-1.5, 1.5) * np.linspace(-0.5, 0.5, width)
    length = int(random.integers(*LENGTHS, endpoint=True))
    rows, columns = np.mgrid[0:height, 0:width]
    result = np.zeros_like(noise)
    for i in range(length):
        along = i - (length - 1) / 2
        y, x = rows + along * np.sin(angle), columns + along * np.cos(angle)
        result += noise[np.rint(y).astype(int) % height, np.rint(x).astype(int) % width]
    return (result - result.mean()) / max(float(result.std()), 1e-6)


def half_plane(random, height, width):
    """One side of a line through the middle, (height, width)."""
    across = random.standard_normal(2) @ np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j].reshape(2, -1)
    return across.reshape(height, width) > 0


def drawn_pattern(random, height, width):
    """A factor on light of a mean near 1, (height, width), its relief and contrast."""
    relief = streaks(random, height, width)
    if random.random() < 0.5:  # in a part of the crop only
        relief = relief * half_plane(random, height, width)
    contrast = random.uniform(*CONTRAST)
    return np.exp(contrast * relief - 0.5 * contrast**2 * (relief != 0)).astype(np.float32), relief, contrast


def patterned(random, stack, targets):
    """The crop with a pattern on its light, noisy and reference alike, so that the noise stays in proportion."""
    pattern, relief, contrast = drawn_pattern(random, *stack.shape[1:])
    stack = stack.copy()
    for light in LIGHTS:
        for layer in (light, f"{light}.noise", f"{light}.root", f"{light}.halves"):
            stack[WHERE[layer]] *= pattern
    if random.random() < SHOWN["albedo"]:
        for layer in ("albedo", "albedo.noise"):
            stack[WHERE[layer]] = np.minimum(stack[WHERE[layer]] * pattern, 1)
    if random.random() < SHOWN["normal"]:
        side = random.standard_normal(3).astype(np.float32)[:, None, None]
        lit = np.linalg.norm(stack[WHERE["normal"]], axis=0, keepdims=True)
        bent = stack[WHERE["normal"]] + contrast * relief * lit * side / np.linalg.norm(side)
        stack[WHERE["normal"]] = bent * lit / np.maximum(np.linalg.norm(bent, axis=0, keepdims=True), 1e-6)
    return stack, {name: target * pattern for name, target in targets.items()}


def missing(random):
    gone = set()
    for names, share in MISSING.items():
        if random.random() < share:
            gone.update(names)
    return set(WHERE) - set(LIGHTS) if random.random() < BARE else gone


def chosen_light(random, given, targets):
    names = [name for name in LIGHTS if name in given]
    whole = targets["rgb"].mean()
    names = [name for name in names if name == "rgb" or targets[name].mean() > FAINT * whole]
    shares = np.array([SHARES[name] for name in names])
    return names[random.choice(len(names), p=shares / shares.sum())]


def varied(random, stack, targets, given, scale):
    """Of a variation of the crop: planes, colour and divisor as of `planes.planes`, and the reference times the exposure."""
    if random.random() < PATTERNED:
        stack, targets = patterned(random, stack, targets)
    name = chosen_light(random, given, targets)
    flips, transposed = random.random(2) < 0.5, random.random() < 0.5
    axes, signs = turned_normals(random, flips, transposed)
    colours = random.permutation(3)
    stack = turn(stack, flips, transposed).copy()
    normal = stack[WHERE["normal"]]
    stack[WHERE["normal"]] = normal[axes] * signs[:, None, None]
    for layer in (*LIGHTS, "albedo"):
        stack[WHERE[layer]] = stack[WHERE[layer]][colours]
    scale = scale * 2.0 ** random.uniform(-STOPS, STOPS)
    inputs, colour, divisor = planes(stack, given - missing(random), name, scale)
    target = scale * np.maximum(turn(targets[name], flips, transposed)[colours], 0)
    return inputs, colour, divisor, target.astype(np.float32)


class Batches:
    """Batch number n is the same in every run with the same seed and the same frames."""

    def __init__(self, cache, size, seed):
        self.cache, self.size, self.seed = cache, size, seed

    def crops(self, random, count):
        """Frames, and a crop of each. Scenes are chosen by the root of how many frames they have."""
        scenes = list(self.cache.scenes().values())
        shares = np.sqrt([len(scene) for scene in scenes])
        for _ in range(count):
            scene = scenes[random.choice(len(scenes), p=shares / shares.sum())]
            frame = scene[random.integers(len(scene))]
            yield frame, *frame.crop(*frame.corner(random, self.size), self.size)

    def batch(self, step, count):
        """Planes, colours, divisors and references of `count` crops."""
        random = np.random.default_rng([self.seed, step])
        parts = [varied(random, stack, targets, frame.given, frame.exposure) for frame, stack, targets in self.crops(random, count)]
        return [np.stack(x) for x in zip(*parts)]
