"""The mixing network: how much of each candidate, and how much of the render.

Source: Firmino et al., "Progressive Denoising of Monte Carlo Rendered Images", section 4. Departures: any number of
candidates beside the render. Each goes through the same U-net, which also sees how it differs from the candidates' mean; what the
U-nets give is averaged into a context, and candidate and context make a logit. So the order does not matter. The logits
correct a rule instead of replacing it (`mixed`): with zeros, weights are the inverses of the estimated errors, and the render's
share is that of equation 9.

The names of the layers are the interface to nn/mix.cpp.
"""

import torch
from torch import nn
from torch.nn import functional

from mix_planes import OWN, SHARED
from model import convolution, doubled

INPUTS = 2 * OWN + SHARED
TINY = 1e-30
MOST_ODDS = 2  # logarithm
POWER = 2  # of estimated errors. The first is best where errors have nothing in common; denoisers err together


class Mix(nn.Module):
    def __init__(self, width=16):
        super().__init__()
        w = self.width = width
        setattr(self, "in", convolution(INPUTS, w, 1))
        self.down0, self.level1 = convolution(w, 2 * w, 2, stride=2), convolution(2 * w, 2 * w, 3)
        self.down1, self.level2 = convolution(2 * w, 2 * w, 2, stride=2), convolution(2 * w, 2 * w, 3)
        self.up1, self.merge1 = convolution(2 * w, 2 * w, 1), convolution(2 * w, 2 * w, 1, bias=False)
        self.up0, self.merge0 = convolution(2 * w, w, 1), convolution(w, w, 3, bias=False)
        self.own, self.context = convolution(w, w, 1, bias=False), convolution(w, w, 1)
        self.weight, self.share = convolution(w, 1, 1), convolution(w, 1, 1)
        self.shareContext = convolution(w, w, 1)
        for layer in (self.weight, self.share):
            nn.init.zeros_(layer.weight)

    def features(self, planes):
        x0 = functional.relu(getattr(self, "in")(planes))
        x1 = functional.relu(self.down0(x0))
        x1 = functional.relu(x1 + self.level1(x1))
        x2 = functional.relu(self.down1(x1))
        x2 = functional.relu(x2 + self.level2(x2))
        y1 = functional.relu(self.merge1(x1) + doubled(self.up1(x2)))
        return functional.relu(self.merge0(x0) + doubled(self.up0(y1)))

    def forward(self, own, shared):
        """own: (frames, candidates, OWN, height, width); shared: (frames, SHARED, height, width), sides multiples of 4.
        Logits of the candidates (frames, candidates, 1, ...) and of the denoised against the render (frames, 1, ...)."""
        frames, count = own.shape[:2]
        apart = own - own.mean(1, keepdim=True)
        planes = torch.cat([own, apart, shared[:, None].expand(-1, count, -1, -1, -1)], 2).flatten(0, 1)
        features = self.features(planes)
        context = features.unflatten(0, (frames, count)).mean(1)
        hidden = functional.relu(self.own(features) + self.context(context).repeat_interleave(count, 0))
        share = self.share(functional.relu(self.shareContext(context)))
        return self.weight(hidden).unflatten(0, (frames, count)).float(), share.float()


def mixed(logits, share, x, noise, samples, y, error, variance, covariance, gate):
    """The mix, as flat/progressive.cpp makes it, but for the gate: there it is that of the candidates' mean.

    x, noise: (frames, 3, ...); samples: (frames, 1, ...); y to covariance: (frames, candidates, 3, ...); gate: the
    same with 1.
    """
    weights = torch.softmax(logits - POWER * error.sum(2, keepdim=True).clamp_min(TINY).log(), 1)
    mean = (weights * y).sum(1)
    apart = ((weights * y * y).sum(1) - mean * mean).clamp_min(0)
    mean_error = torch.maximum((weights * error).sum(1) - apart, (weights * weights * error).sum(1))
    doubt = torch.where(samples > 1, (samples + 11) / (samples - 1).clamp_min(1), torch.ones_like(samples))
    c = (weights * covariance).sum(1)
    ours = (doubt * torch.maximum((weights * variance).sum(1), noise) - c).clamp_min(0) * share.clamp(-MOST_ODDS, MOST_ODDS).exp()
    theirs = (mean_error - c).clamp_min(0)
    taken = torch.where(theirs > 0, ours / (ours + theirs).clamp_min(TINY), torch.ones_like(ours))
    taken = torch.minimum(taken, 1 - (weights * gate).sum(1) / doubt)
    return x + taken * (mean - x), weights


def gigaflops_per_megapixel(width=16):
    """Of a candidate; a multiplication and an addition are two operations."""
    model, operations = Mix(width), 0
    for name, layer in model.named_children():
        at = 1 / 16 if name in ("down1", "level2", "up1") else 1 / 4 if name in ("down0", "level1", "merge1", "up0") else 1
        operations += layer.weight.numel() * at
    return 2e-3 * operations
