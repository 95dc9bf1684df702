"""What the training of the layered network minimises.

The error of the composited colour is what the paper has (section 4, SMAPE) and the squared term of `loss.py`; alpha, and the colours at half
and quarter size, have small losses of their own. So that layers are of use by themselves, samples of a pixel, or of near pixels, at clearly
different depths are pulled to different layers, the nearer to the one in front: strongly while the training settles, a little afterwards. And
a sample should lie in one layer rather than in all.
"""

import torch

from loss import COARSE, LOGITS, mean_squares, relative_square, smape
from model import half_size

SQUARED = 1.5  # weight of the relative squared error, three times that of loss.py: hair gains by it
FEATURES = 3e-5  # as in loss.py; but at 1e-3 the features at half and quarter size died within 1500 steps
ALPHA = 0.5  # weight of the mean square error of alpha
APART = (1.0, 0.1)  # weight of the order of depths: at first, and in the end
GAP = 0.1  # a relative distance in depth from which on samples belong to different layers
STEPS_BETWEEN = (1, 2, 4, 9, 27, 45)  # how far apart in the list the pairs are that are looked at
REACH = 6  # most pixels between them
UNDECIDED = 0.02  # weight of how far samples are from lying in one layer


def order(result, samples):
    """How far pairs of samples are from lying in layers as far apart as their depths, 0 to 1 each (2 the wrong way round), averaged."""
    layers, width = result.partition.shape[1], samples.shape[2]
    place = result.partition @ torch.arange(layers, dtype=torch.float32)
    total, count = place.new_zeros(()), 0
    for step in STEPS_BETWEEN:
        z0, z1 = samples.depth[:-step], samples.depth[step:]
        p0, p1 = samples.pixel[:-step], samples.pixel[step:]
        together = (p1 - p0 <= REACH) & (p1 // width == p0 // width)
        apart = ((z1 - z0) / (GAP * torch.minimum(z0, z1).clamp(min=1e-6))).clamp(-1, 1) * together
        weight = apart.abs() * (samples.weight[:-step] + samples.weight[step:])
        short = (apart.abs() - apart.sign() * (place[step:] - place[:-step])).clamp(min=0)
        total = total + (weight * short).sum()
        count = count + weight.sum()
    return total / (count + 1e-6)


def undecided(result, samples):
    """0 where every sample lies in one layer, up to 1."""
    return (samples.weight * (1 - (result.partition**2).sum(1))).sum() / (samples.weight.sum() + 1e-6)


def loss(result, samples, targets, settled):
    """The error at full size, and what is to be minimised; targets (frames, 8, height, width): light, alpha, whether they count, and other light of the pixel;
    settled: from 0 to 1, how far the training is with that."""
    light, alpha, counts, other = targets[:, :3], targets[:, 3:4], targets[:, 4:5] > 0, targets[:, 5:]
    colour = torch.where(counts, result.colour, light)
    error = smape(colour, light, other)
    total = error + SQUARED * relative_square(colour, light, other) + LOGITS * mean_squares(result.logits) + FEATURES * mean_squares(result.features)
    total = total + ALPHA * ((result.alpha - alpha) ** 2).mean()
    whole = counts.float()
    for coarse, weight in zip(result.coarse, COARSE):
        light, whole, other = half_size(light), half_size(whole), half_size(other)
        total = total + weight * smape(torch.where(whole > 0.99, coarse, light), light, other)
    if result.partition.shape[1] > 1:
        first, last = APART
        total = total + (first + (last - first) * settled) * order(result, samples) + UNDECIDED * undecided(result, samples)
    return error.detach(), total
