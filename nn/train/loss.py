"""What training minimises."""

import torch

from model import half_size

EPSILON = 1e-2  # equation 1
COARSE = (0.1, 0.05)  # weights of the results at half and at quarter size; the paper has only the full size
# Weights of the mean squares of the kernels' logits, and of the features that they are made of. Without the first, a few
# hundred steps drive logits to where the softmax is flat, the filters stay identities, and nothing is learned (the
# paper's section 7 knows this of its own training). Without the second, the same push makes the coarse features so large
# that the fine ones behind them do not count.
LOGITS, FEATURES = 1e-4, 1e-3
# Weight of the relative squared error, which is what is reported: SMAPE alone draws to the median, and the figure asks for
# the mean. Its largest terms are cut: a firefly in a reference teaches nothing.
SQUARED, DARK, LARGEST = 0.5, 0.05, 4.0
UNIFORM = 10.0  # weight of the variance of the masks early in training (supplement, section 2.2)


def smape(result, reference, other=0):
    """Equation 1: the symmetric mean absolute percentage error, of colours times the exposure; where these are a part of the light, of the
    whole with the `other` part as it should be. (Of the part alone, light beside what has none would cost as much as all light missing.)"""
    return ((reference - result).abs() / (reference.abs() + result.abs() + 2 * other + EPSILON)).mean()


def relative_square(result, reference, other=0):
    return ((result - reference) ** 2 / ((reference + other) ** 2 + DARK)).clamp(max=LARGEST).mean()


def mask_variance(masks):
    """Equation 2 of the supplement; masks are (K, frames, 3, height, width)."""
    return ((masks - 1 / len(masks)) ** 2).mean()


def mean_squares(tensors):
    return sum((x.float() ** 2).mean() for x in tensors)


def loss(result, divisor, reference, settling):
    """Of `model.Result`: the error at full size, and what is to be minimised. Coarser results are compared as they are, divided."""
    colour = result.colours[0] * divisor
    error = smape(colour, reference)
    total = error + SQUARED * relative_square(colour, reference)
    reference = reference / divisor
    total = total + LOGITS * mean_squares(result.logits) + FEATURES * mean_squares(result.features)
    for colour, weight in zip(result.colours[1:], COARSE):
        reference = half_size(reference)
        total = total + weight * smape(colour, reference)
    if settling and len(result.masks) > 1:
        total = total + UNIFORM * mask_variance(result.masks)
    return error.detach(), total


def schedule(step, steps, warmup):
    """The share of the learning rate: a linear start, then half a cosine down to a hundredth."""
    if step < warmup:
        return (step + 1) / warmup
    along = min(1.0, (step - warmup) / max(1, steps - warmup))
    return 0.01 + 0.99 * 0.5 * (1 + float(torch.cos(torch.tensor(torch.pi * along))))
