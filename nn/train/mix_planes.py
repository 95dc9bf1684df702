"""What the mixing network sees of a frame, and what the mix is made of.

`shared` gives the planes of the frame, `own` those of one candidate, both float32 (planes, height, width), after all light is
brought to one exposure (`planes.exposure`); flat/mix_planes.cpp makes the same. x is the render, y the candidate, in
exposed units, relative quantities are means over R, G, B over (mean of y)^2 + DARK.

  shared 0-2   log(1 + x)                       own 0-2  log(1 + y)
         3-5   albedo                               3-5  logarithms of the relative error, spread and variance of the render
         6-8   normal                               6    covariance over variance
         9     depth z / (z + its mean)             7    y - x over the deviation of x
         10    logarithm of x's relative variance   8    the gate
         11    logarithm of the samples             9    as 3, of the frame's mean
"""

import numpy as np

from planes import component, finite, measure, triple, WHERE

SHARED, OWN = 12, 10
DARK = 0.01
LEAST = 1e-6  # relative error
LARGEST_RESIDUAL = 4


def logarithm(relative):
    """About -3 to 3."""
    return (np.log(relative + LEAST) + 5) / 3


def of(candidates, base, what, scale):
    return finite(np.stack([candidates[f"{base}.{what}{c}"] for c in "RGB"])) * np.float32(scale)


def samples_of(noisy, spp):
    if "samples" in noisy:
        return np.maximum(finite(noisy["samples"]), 1)
    return np.full_like(noisy["R"], max(spp or 1, 1))


def render(noisy, spp, scale):
    """x, its variance (3, height, width each) and samples (height, width)."""
    x = component(noisy, "rgb") * np.float32(scale)
    variance = triple(noisy, "variance")
    return x, np.maximum(variance, 0) * np.float32(scale**2), samples_of(noisy, spp)


def shared(noisy, spp, scale):
    x, variance, samples = render(noisy, spp, scale)
    stack, _ = measure(noisy)
    depth = stack[WHERE["depth"]]
    level = np.maximum(x, 0).mean(0, keepdims=True) ** 2 + DARK
    result = [
        np.log1p(np.maximum(x, 0)),
        np.clip(stack[WHERE["albedo"]], 0, 1),
        np.clip(stack[WHERE["normal"]], -1, 1),
        depth / (depth + 1),
        logarithm(variance.mean(0, keepdims=True) / level),
        np.log2(samples)[None] / 4 - 1,
    ]
    return np.concatenate(result).astype(np.float32)


def parts(candidates, base, scale):
    """y, error, variance and covariance (3, height, width each), and the gate (1, height, width)."""
    square = scale**2
    maps = [of(candidates, base, f"{what}.", square) for what in ("error", "variance", "covariance")]
    return [of(candidates, base, "", scale), *maps, candidates[f"{base}.gate"][None]]


def own(noisy, spp, candidates, base, scale):
    x, noise, _ = render(noisy, spp, scale)
    y, error, variance, covariance, gate = parts(candidates, base, scale)
    spread = of(candidates, base, "spread.", scale**2)
    y = np.maximum(y, 0)
    level = y.mean(0, keepdims=True) ** 2 + DARK
    relative = [q.mean(0, keepdims=True) / level for q in (error, spread, variance)]
    residual = (y - x).sum(0, keepdims=True) / np.sqrt(noise.sum(0, keepdims=True) + 1e-4 * level)
    frame = logarithm(relative[0].mean(dtype=np.float64))
    result = [
        np.log1p(y),
        *(logarithm(q) for q in relative),
        covariance.sum(0, keepdims=True) / (variance.sum(0, keepdims=True) + LEAST * level),
        np.clip(residual, -LARGEST_RESIDUAL, LARGEST_RESIDUAL),
        gate,
        np.full_like(gate, frame),
    ]
    return np.concatenate(result).astype(np.float32)
