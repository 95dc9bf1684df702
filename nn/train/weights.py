"""Weight files: safetensors, which are eight bytes with the length of a JSON header, the header, and raw tensors."""

import json
import struct

import numpy as np
import torch

from model import INPUTS, Compositional

FORMAT, VERSION = "fathom-compositional", "1"
TYPES = {"F32": np.dtype("<f4")}
ALIGNMENT = 8


def write_tensors(path, tensors, metadata=None):
    """Writes {name: float32 array} in the order of their names, and strings of metadata."""
    header, begin, parts = {"__metadata__": metadata} if metadata else {}, 0, []
    for name in sorted(tensors):
        data = np.ascontiguousarray(tensors[name], TYPES["F32"])
        header[name] = {"dtype": "F32", "shape": list(data.shape), "data_offsets": [begin, begin + data.nbytes]}
        begin += data.nbytes
        parts.append(data.tobytes())
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % ALIGNMENT)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(parts))


def read_tensors(path):
    """{name: float32 array} and the metadata. ValueError where the file is no safetensors file of float32."""
    with open(path, "rb") as file:
        data = file.read()
    try:
        (length,) = struct.unpack_from("<Q", data)
        header = json.loads(data[8 : 8 + length])
        metadata = header.pop("__metadata__", {})
        body = memoryview(data)[8 + length :]
        tensors = {}
        for name, entry in header.items():
            begin, end = entry["data_offsets"]
            flat = np.frombuffer(body[begin:end], TYPES[entry["dtype"]])
            tensors[name] = flat.reshape(entry["shape"]).copy()
    except (struct.error, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: not a safetensors file of float32: {error}") from error
    return tensors, metadata


def save_model(path, model, metadata):
    state = {name: tensor.detach().float().numpy() for name, tensor in model.state_dict().items()}
    fixed = {"format": FORMAT, "version": VERSION, "width": str(model.width), "inputs": str(INPUTS)}
    write_tensors(path, state, {**fixed, **metadata})


def load_model(path):
    """The model of a weight file or of a checkpoint, ready to denoise."""
    if str(path).endswith(".pt"):
        saved = torch.load(path, map_location="cpu")
        width, state = saved["width"], saved["average"]
    else:
        tensors, metadata = read_tensors(path)
        if metadata.get("format") != FORMAT or metadata.get("version") != VERSION:
            raise ValueError(f"{path}: expected {FORMAT} version {VERSION}, found {metadata}")
        width, state = int(metadata["width"]), {name: torch.from_numpy(x) for name, x in tensors.items()}
    model = Compositional(width)
    model.load_state_dict(state)
    return model.eval()
