"""The compositional denoiser: kernel prediction at three scales behind a learned decomposition.

Source: Zhang et al., "Deep Compositional Denoising for High-quality Monte Carlo Rendering" (section 3 and section 2 of
its supplement) over the kernel prediction of Vogels et al. 2018. Departures: one residual block per scale instead of
two, a width of 16 or 32 instead of 64, and the constant planes and half buffers among the inputs (`planes.py`).

Shapes are (frames, channels, height, width), height and width multiples of 4. `planes` are the 24 of `planes.py`,
`colour` is linear light times the frame's exposure, at least 0. K, the number of components, is 1, 2 or 4 and is chosen
with each call: all nodes of the decomposition share their weights.

The names of the layers are the interface to the C++ side: `state_dict()` and the weight file have the same names.
"""

from collections import namedtuple

import torch
from torch import nn
from torch.nn import functional

INPUTS = 24
COMPONENTS = (1, 2, 4)
RADIUS = 2
TAPS = (2 * RADIUS + 1) ** 2

# colours: the result at full, half and quarter size; masks: (K, frames, 3, height, width), they sum to 1 over K;
# logits: of the kernels, and features: what they are made of, of all scales.
Result = namedtuple("Result", "colours masks logits features")


def convolution(inputs, outputs, size, stride=1, bias=True):
    layer = nn.Conv2d(inputs, outputs, size, stride, padding=1 if size == 3 else 0, bias=bias)
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    if bias:
        nn.init.zeros_(layer.bias)
    return layer


class Block(nn.ModuleList):
    """Two 3x3 convolutions around which the input passes."""

    def __init__(self, width):
        super().__init__([convolution(width, width, 3), convolution(width, width, 3)])
        with torch.no_grad():
            self[1].weight.mul_(0.5)  # the sum with the input keeps its variance

    def forward(self, x):
        return functional.relu(x + self[1](functional.relu(self[0](x))))


class Input(nn.Module):
    """Where a U-net takes its features and its colour."""

    def __init__(self, width):
        super().__init__()
        self.features = convolution(width, width, 3)
        self.colour = convolution(3, width, 3, bias=False)

    def forward(self, colour, features):
        return self.features(features) + self.colour(torch.log1p(colour))


def doubled(x):
    return functional.interpolate(x, scale_factor=2, mode="nearest")


class UNet(nn.Module):
    """Three scales of w, 2w and 4w channels, behind an entry that has w. `scales` gives all three, finest first."""

    def __init__(self, width, entry):
        super().__init__()
        w = width
        setattr(self, "in", entry)
        self.level0, self.level1, self.level2 = Block(w), Block(2 * w), Block(4 * w)
        self.down0, self.down1 = convolution(w, 2 * w, 2, stride=2), convolution(2 * w, 4 * w, 2, stride=2)
        self.up1, self.merge1 = convolution(4 * w, 2 * w, 1), convolution(4 * w, 2 * w, 3)
        self.up0, self.merge0 = convolution(2 * w, w, 1), convolution(2 * w, w, 3)

    def scales(self, *inputs):
        x0 = self.level0(functional.relu(getattr(self, "in")(*inputs)))
        x1 = self.level1(functional.relu(self.down0(x0)))
        x2 = self.level2(functional.relu(self.down1(x1)))
        y1 = functional.relu(self.merge1(torch.cat([doubled(self.up1(x2)), x1], 1)))
        y0 = functional.relu(self.merge0(torch.cat([doubled(self.up0(y1)), x0], 1)))
        return y0, y1, x2


class Decompose(UNet):
    """Splits a component in two, each with features of its own."""

    def __init__(self, width):
        super().__init__(width, Input(width))
        self.mask = convolution(width, 3, 1)
        with torch.no_grad():
            self.mask.weight.mul_(0.1)  # begin with halves
        self.first, self.second = Block(width), Block(width)

    def forward(self, colour, features):
        y0 = self.scales(colour, features)[0]
        return torch.sigmoid(self.mask(y0).float()), self.first(y0), self.second(y0)


def half_size(x):
    return functional.avg_pool2d(x, 2)


def upsampled(x):
    return functional.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


class Gather(torch.autograd.Function):
    """Sums the taps of padded colours by their weights. Automatic differentiation gives the same and takes half of all
    time: it clears an image for each tap."""

    @staticmethod
    def taps(padded, height, width):
        for tap in range(TAPS):
            y, x = divmod(tap, 2 * RADIUS + 1)
            yield tap, padded[:, :, y : y + height, x : x + width]

    @staticmethod
    def forward(context, weights, padded):
        context.save_for_backward(weights, padded)
        height, width = weights.shape[2:]
        result = padded.new_zeros(*padded.shape[:2], height, width)
        for tap, colour in Gather.taps(padded, height, width):
            result.addcmul_(weights[:, tap : tap + 1], colour)
        return result

    @staticmethod
    def backward(context, gradient):
        weights, padded = context.saved_tensors
        gradient = gradient.contiguous()
        height, width = weights.shape[2:]
        to_weights = torch.empty_like(weights)
        for tap, colour in Gather.taps(padded, height, width):
            torch.sum(gradient * colour, 1, out=to_weights[:, tap])
        to_padded = None
        if context.needs_input_grad[1]:
            to_padded = torch.zeros_like(padded)
            for tap, colour in Gather.taps(to_padded, height, width):
                colour.addcmul_(weights[:, tap : tap + 1], gradient)
        return to_weights, to_padded


def filtered(logits, colour):
    """Gathers `colour` with the softmax of 25 logits per pixel; beyond the border lies the border's colour."""
    weights = torch.softmax(logits.float().contiguous(), 1)
    return Gather.apply(weights, functional.pad(colour.contiguous(), [RADIUS] * 4, mode="replicate"))


def mixed(fine, coarse, logit):
    """Takes the low frequencies of `fine` from `coarse` instead, as far as the logit says."""
    return fine + torch.sigmoid(logit.float()) * upsampled(coarse - half_size(fine))


class Denoise(UNet):
    """Filters one component with kernels of 5x5 at three scales."""

    def __init__(self, width):
        super().__init__(width, Input(width))
        self.kernel0 = convolution(width, TAPS + 1, 1)
        self.kernel1 = convolution(2 * width, TAPS + 1, 1)
        self.kernel2 = convolution(4 * width, TAPS, 1)
        with torch.no_grad():
            for layer in (self.kernel0, self.kernel1, self.kernel2):
                layer.weight.mul_(0.1)  # begin with box filters

    def forward(self, colour, features):
        scales = self.scales(colour, features)
        logits0, logits1, logits2 = (f(x) for f, x in zip((self.kernel0, self.kernel1, self.kernel2), scales))
        colour1 = half_size(colour)
        r2 = filtered(logits2, half_size(colour1))
        r1 = mixed(filtered(logits1[:, :TAPS], colour1), r2, logits1[:, TAPS:])
        r0 = mixed(filtered(logits0[:, :TAPS], colour), r1, logits0[:, TAPS:])
        return (r0, r1, r2), (logits0[:, :TAPS], logits1[:, :TAPS], logits2), scales


class Encoder(nn.Module):
    def __init__(self, width):
        super().__init__()
        setattr(self, "in", convolution(INPUTS, width, 3))
        self.block = Block(width)

    def forward(self, planes):
        return self.block(functional.relu(getattr(self, "in")(planes)))


class Compositional(nn.Module):
    def __init__(self, width):
        super().__init__()
        self.width = width
        self.encoder, self.decompose, self.denoise = Encoder(width), Decompose(width), Denoise(width)

    def forward(self, planes, colour, components):
        """The denoised colour (frames, 3, height, width)."""
        return self.result(planes, colour, components).colours[0]

    def result(self, planes, colour, components):
        if components not in COMPONENTS:
            raise ValueError(f"components: expected one of {COMPONENTS}, found {components}")
        frames = len(colour)
        features = self.encoder(planes)
        masks = torch.ones_like(colour)
        nodes = colour
        # Nodes of one depth lie behind one another in the first dimension, so that each step is one call.
        while len(nodes) < components * frames:
            mask, first, second = self.decompose(nodes, features)
            features = torch.cat([first, second])
            masks = torch.cat([mask * masks, (1 - mask) * masks])
            nodes = torch.cat([mask * nodes, (1 - mask) * nodes])
        scales, logits, features = self.denoise(nodes, features)
        colours = [x.reshape(components, frames, *x.shape[1:]).sum(0) for x in scales]
        return Result(colours, masks.reshape(components, *colour.shape), logits, features)


def denoised(model, planes, colour, components):
    """As the call of the model, for sides of any length: what lacks to a multiple of 4 is padded and cropped again."""
    height, width = colour.shape[2:]
    padding = [0, -width % 4, 0, -height % 4]
    planes, colour = (functional.pad(x, padding, mode="replicate") for x in (planes, colour))
    return model(planes, colour, components)[:, :, :height, :width]


# Layers that work on a half or a quarter of the sides.
QUARTER = {"down0", "level1", "merge1", "up0", "kernel1"}
SIXTEENTH = {"down1", "level2", "up1", "kernel2"}


def gigaflops_per_megapixel(width, components):
    """Of one forward pass over one component; a multiplication and an addition are two operations."""
    calls = {"encoder": 1, "decompose": components - 1, "denoise": components}
    operations = components * 3 * TAPS * (1 + 1 / 4 + 1 / 16)  # where kernels are applied
    for name, weights in Compositional(width).state_dict().items():
        part, layer, *_ = name.split(".")
        if name.endswith(".weight"):
            share = 1 / 4 if layer in QUARTER else 1 / 16 if layer in SIXTEENTH else 1
            operations += calls[part] * weights.numel() * share
    return 2 * operations / 1000
