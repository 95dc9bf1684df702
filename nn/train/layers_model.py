"""The layered denoiser: a learned partition of samples into layers, filtered one by one and composited front to back.

Source: Munkberg and Hasselgren 2020, "Neural Denoising with Layer Embeddings" (sections 3 and 6, appendix A), with kernels of 5x5
at three scales. Departures: relu; the smaller U-net of `model.py`; kernels are exponentials of clamped logits, with no maximum of the
frame taken off; the scales of a layer are joined before compositing, so that layers exist at full size and flatten to the result;
what misses everything passes all layers; partitions below FLOOR are none, so that layers can be empty.

Samples are a ragged list: `pixel` says for each of S samples in which of frames * height * width pixels it lies. Sides are multiples of
4. A layer's kernels depend on the layer by its embeddings alone: the same weights serve 1, 2 and 4 layers. Diffuse and specular light are filtered
apart, with their own kernels, in the layers that the samples were put in with the diffuse light (`together`). Diffuse light is divided by the
albedo of its sample, and what a layer becomes is multiplied by the albedo of the pixel's own samples in that layer (`multiplied`).

The names of the layers are the interface to the C++ side: `state_dict()` and the weight file have the same names.
"""

from collections import namedtuple

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from model import RADIUS, TAPS, Gather, UNet, convolution, half_size, upsampled
from samples import LEAST_ALBEDO

INPUTS = 20
EMBEDDING = 32
LAYERS = (1, 2, 4)
HIDDEN = 16  # of the partition
FLOOR = 0.01
LARGEST_LOGIT = 12.0
STEEPEST = 1e-3  # gradient of a share; those of a loss that is a mean over crops are a hundredth of this
TINY = 1e-12
OWN = 0.125  # the weight of what the kernels make of the divisor, beside that of a pixel's own samples
SCALES = 3

# inputs: (S, 20), see samples.py; weight: (S,), a pixel's sum is at most 1; light: (S, 3), times the exposure, not premultiplied;
# depth: (S,); divisor: (S, 3), what light was divided by; pixel: (S,) integers; shape: (frames, height, width).
Samples = namedtuple("Samples", "inputs weight light depth divisor pixel shape")

# colour (frames, 3, height, width) and alpha (frames, 1, height, width); radiance (L, frames, 3, height, width), opacity and depth
# (L, frames, 1, height, width): of the layers, front to back, premultiplied. partition: (S, L). logits: of all kernels; `features`: what they
# are made of; coarse: the composited colours at half and at quarter size.
Result = namedtuple("Result", "colour alpha radiance opacity depth partition logits features coarse")


def assembled(parts, shape):
    """Samples of frames of one shape, from the arrays of each: inputs, weight, light, depth, divisor, and pixel within the frame."""
    columns = [list(x) for x in zip(*parts)]
    columns[-1] = [pixel + k * shape[0] * shape[1] for k, pixel in enumerate(columns[-1])]
    tensors = [torch.from_numpy(np.concatenate(x)) for x in columns]
    return Samples(*(x.float() for x in tensors[:-1]), tensors[-1].long(), (len(parts), *shape))


def dense(layer, rows):
    """A 1x1 convolution over a list."""
    return functional.linear(rows, layer.weight[:, :, 0, 0], layer.bias)


class Splat(torch.autograd.Function):
    """Spreads each pixel's values by its own 25 weights: the transpose of model.Gather. What falls outside is lost."""

    @staticmethod
    def forward(context, weights, values):
        context.save_for_backward(weights, values)
        height, width = values.shape[2:]
        padded = values.new_zeros(*values.shape[:2], height + 2 * RADIUS, width + 2 * RADIUS)
        for tap, target in Gather.taps(padded, height, width):
            target.addcmul_(weights[:, tap : tap + 1], values)
        return padded[:, :, RADIUS:-RADIUS, RADIUS:-RADIUS].contiguous()

    @staticmethod
    def backward(context, gradient):
        weights, values = context.saved_tensors
        padded = functional.pad(gradient.contiguous(), [RADIUS] * 4)
        to_weights, to_values = torch.empty_like(weights), torch.zeros_like(values)
        for tap, part in Gather.taps(padded, *values.shape[2:]):
            torch.sum(part * values, 1, out=to_weights[:, tap])
            to_values.addcmul_(weights[:, tap : tap + 1], part)
        return to_weights, to_values


class Joined(nn.Module):
    """Reads a pixel's context and an embedding, as if they stood behind one another; `later` are the layers after."""

    def __init__(self, context, widths):
        super().__init__()
        self.context = convolution(context, widths[0], 1)
        self.embedding = convolution(EMBEDDING, widths[0], 1, bias=False)
        self.later = [str(k) for k in range(1, len(widths))]
        for k, inputs, outputs in zip(self.later, widths, widths[1:]):
            setattr(self, k, convolution(inputs, outputs, 1))

    def rest(self, x, apply):
        for k in self.later:
            x = apply(getattr(self, k), functional.relu(x))
        return x

    def images(self, context, embedding):
        """Contexts (frames, ...) and embeddings (layers * frames, ...)."""
        context = self.context(context)
        context = context.repeat(len(embedding) // len(context), 1, 1, 1)
        return self.rest(context + self.embedding(embedding), lambda layer, x: layer(x))

    def rows(self, context, embedding, pixel):
        """Contexts per pixel and embeddings per sample."""
        return self.rest(dense(self.context, context)[pixel] + dense(self.embedding, embedding), dense)


class Sharpened(torch.autograd.Function):
    """The partition with small parts taken off. Its gradient is the softmax's, or no sample would come back from a certain choice; and bounded:
    the first sample of a layer that was empty changes all that is seen of it."""

    @staticmethod
    def forward(_, q):
        cut = (q - FLOOR).clamp(min=0)
        return cut / cut.sum(1, keepdim=True)

    @staticmethod
    def backward(_, gradient):
        return gradient.clamp(-STEEPEST, STEEPEST)


def multiplied(filtered, own):
    """Light times the divisor of the pixel's own samples, and of those around it where it has few. Where bright light comes of little albedo,
    as through leaves and curtains, the mean of quotients times that of divisors is too much: what the kernels make of the light before, over
    what they make of divisors, is the most."""
    around = (filtered[:, 5:8] / filtered[:, 3:4].clamp(min=TINY)).detach().clamp(min=LEAST_ALBEDO)
    return torch.minimum(filtered[:, :3], filtered[:, 8:] / around) * (own[:, 2:] + OWN * around) / (own[:, :1] + OWN)


def rows_of(image):
    """(frames * height * width, channels) of an image."""
    return image.permute(0, 2, 3, 1).reshape(-1, image.shape[1])


def composited(radiance, opacity):
    """Front to back over the first dimension: colour and alpha."""
    colour, passed = torch.zeros_like(radiance[0]), torch.ones_like(opacity[0])
    for rad, alpha in zip(radiance, opacity):
        colour = colour + passed * rad
        passed = passed * (1 - alpha)
    return colour, 1 - passed


class Layered(nn.Module):
    def __init__(self, width):
        super().__init__()
        self.width = width
        self.reducer = nn.ModuleList(convolution(n, EMBEDDING, 1) for n in (INPUTS, EMBEDDING, EMBEDDING))
        self.unet = UNet(width, convolution(EMBEDDING, width, 3))
        self.partition = Joined(width, (EMBEDDING, HIDDEN, LAYERS[-1]))
        for k in range(SCALES):
            setattr(self, f"kernel{k}", Joined(width << k, (EMBEDDING, EMBEDDING, TAPS + (0 if k else SCALES))))
        with torch.no_grad():
            for joined in (self.partition, self.kernel0, self.kernel1, self.kernel2):
                getattr(joined, joined.later[-1]).weight.mul_(0.1)  # begin with even shares and box filters

    def forward(self, samples, layers):
        """The denoised colour, times the exposure."""
        return self.result(samples, layers).colour

    def embedded(self, samples):
        x = samples.inputs
        for layer in self.reducer:
            x = functional.relu(dense(layer, x))
        return x.float()

    def shares(self, context, embedding, pixel, layers):
        """Which share of a sample goes to which layer, (S, L)."""
        if layers == 1:
            return torch.ones_like(embedding[:, :1])
        logits = self.partition.rows(context, embedding, pixel).float()[:, :layers]
        return Sharpened.apply(torch.softmax(logits, 1))

    def filtered(self, k, context, values, embedding):
        """Values after the kernels of scale k, and the logits."""
        logits = getattr(self, f"kernel{k}").images(context, embedding).float()
        kernels = torch.exp(logits[:, :TAPS].clamp(-LARGEST_LOGIT, LARGEST_LOGIT))
        spread = Splat.apply(kernels.contiguous(), values.contiguous())
        occupancy = spread[:, 4:5] + TINY
        opacity = (spread[:, 3:4] / occupancy).clamp(max=1)
        return torch.cat([spread[:, :3] / occupancy, opacity, spread[:, 5:] / occupancy], 1), logits

    def result(self, samples, layers, partition=None):
        """partition: what another light of the same samples had, where that is to be kept."""
        if layers not in LAYERS:
            raise ValueError(f"layers: expected one of {LAYERS}, found {layers}")
        frames, height, width = samples.shape

        def summed(values):
            """Over the samples of each pixel, as an image."""
            sums = values.new_zeros(frames * height * width, values.shape[1]).index_add_(0, samples.pixel, values)
            return sums.reshape(frames, height, width, -1).permute(0, 3, 1, 2)

        weight = samples.weight[:, None]
        embedding = self.embedded(samples)
        scales = self.unet.scales(summed(weight * embedding))
        if partition is None:
            partition = self.shares(rows_of(scales[0]), embedding, samples.pixel, layers)
        # Light, weight, depth, divisor and light before that, then the embedding: what a sample gives to a layer, for its share.
        before = samples.light * samples.divisor
        given = torch.cat([samples.light, torch.ones_like(weight), samples.depth[:, None], samples.divisor, before, embedding], 1)
        sums = [summed(weight * partition[:, k : k + 1] * given) for k in range(layers)]
        missed = (1 - sum(x[:, 3:4] for x in sums)).clamp(min=0)
        behind, values = missed, []
        for x in reversed(sums):
            behind = behind + x[:, 3:4]  # occupancy: 1 less what the layers in front took
            values.insert(0, torch.cat([x[:, :4], behind, x[:, 4:11]], 1))
        values, embeddings = torch.cat(values), torch.cat([x[:, 11:] for x in sums])
        own = torch.cat([x[:, 3:8] for x in sums])

        spread, logits, owned = [], [], []
        for k in range(SCALES):
            filtered, logit = self.filtered(k, scales[k], values, embeddings)
            spread.append(filtered)
            logits.append(logit)
            owned.append(own)
            values, embeddings, own = half_size(values), half_size(embeddings), half_size(own)
        apart = [self.apart(x, y, layers) for x, y in zip(spread, owned)]
        coarse = [composited(x[0], x[1])[0] for x in apart[1:]]
        mix = torch.softmax(logits[0][:, TAPS:], 1)
        full = [spread[0], upsampled(spread[1]), upsampled(upsampled(spread[2]))]
        radiance, opacity, depth = self.apart(sum(mix[:, k : k + 1] * x for k, x in enumerate(full)), owned[0], layers)
        colour, alpha = composited(radiance, opacity)
        return Result(colour, alpha, radiance, opacity, depth, partition, [x[:, :TAPS] for x in logits], scales, coarse)

    @staticmethod
    def apart(filtered, own, layers):
        """Radiance, opacity and depth, (layers, frames, ...), of what has the layers behind one another; own: weight, depth and divisor of
        the pixels' samples."""
        x = torch.cat([multiplied(filtered, own), filtered[:, 3:5]], 1).reshape(layers, -1, 5, *filtered.shape[2:])
        return x[:, :, :3], x[:, :, 3:4], x[:, :, 4:5]


def together(results):
    """Of lights that were filtered apart with one partition: colours add up, what a layer covers is the mean."""
    opacity, depth = (sum(getattr(x, name) for x in results) / len(results) for name in ("opacity", "depth"))
    radiance = sum(x.radiance for x in results)
    colour, alpha = composited(radiance, opacity)
    return results[0]._replace(colour=colour, alpha=alpha, radiance=radiance, opacity=opacity, depth=depth)


def gigaflops_per_megapixel(width, layers, samples):
    """Of one forward pass over frames with so many samples per pixel; a multiplication and an addition are two operations."""
    operations = layers * 6 * TAPS * (1 + 1 / 4 + 1 / 16)
    share = {"down0": 4, "level1": 4, "merge1": 4, "up0": 4, "down1": 16, "level2": 16, "up1": 16, "kernel0": 1, "kernel1": 4, "kernel2": 16}
    for name, weights in Layered(width).state_dict().items():
        part, layer, *_ = name.split(".")
        if name.endswith("weight"):
            calls = samples if part == "reducer" or (part == "partition" and layer != "context") else 1
            calls = layers if part.startswith("kernel") and layer != "context" else calls
            operations += calls * weights.numel() / share.get(layer, share.get(part, 1))
    return 2 * operations / 1000
