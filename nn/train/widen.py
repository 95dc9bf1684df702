"""A network of twice the width that computes the same, to go on from.

Source: Chen et al. 2016, "Net2Net", section 2.2: every hidden channel stands twice, and what read it once reads both by
shares that add to 1. The shares are drawn, so that the copies learn to differ.
"""

import torch

from model import Compositional

SHARES = (0.25, 0.75)  # of the first copy
JOINED = ("merge0", "merge1")  # layers that read two tensors behind one another


def doubled_channels(tensor, dimension, parts=1):
    """Each of the `parts` of a dimension, twice behind itself."""
    return torch.cat([x for part in tensor.chunk(parts, dimension) for x in (part, part)], dimension)


def widened(model, seed=1):
    """`model`, a Compositional, at twice its width."""
    random = torch.Generator().manual_seed(seed)
    wide = Compositional(2 * model.width)
    shapes = {name: x.shape for name, x in wide.state_dict().items()}
    state = {}
    for name, tensor in model.state_dict().items():
        if shapes[name][0] == 2 * tensor.shape[0]:
            tensor = doubled_channels(tensor, 0)
        if tensor.dim() > 1 and shapes[name][1] == 2 * tensor.shape[1]:
            parts = 2 if name.split(".")[-2] in JOINED else 1
            low, high = SHARES
            share = low + (high - low) * torch.rand(tensor.shape[:2], generator=random)[:, :, None, None]
            shares = torch.cat([x for part in share.chunk(parts, 1) for x in (part, 1 - part)], 1)
            tensor = doubled_channels(tensor, 1, parts) * shares
        state[name] = tensor
    wide.load_state_dict(state)
    return wide
