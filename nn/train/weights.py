"""Weight files: safetensors, which are eight bytes with the length of a JSON header, the header, and raw tensors."""

import json
import struct

import numpy as np
import torch

import layers_model
import model

# {model: format and further metadata} of a file. Compositional denoisers of version 1 saw diffuse light as it is (planes.py).
FORMATS = {
    model.Compositional: {"format": "fathom-compositional", "version": "2", "inputs": str(model.INPUTS)},
    layers_model.Layered: {"format": "fathom-layers", "version": "1", "inputs": str(layers_model.INPUTS), "embedding": str(layers_model.EMBEDDING)},
}
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


def save_model(path, network, metadata):
    state = {name: tensor.detach().float().numpy() for name, tensor in network.state_dict().items()}
    fixed = {"width": str(network.width), **FORMATS[type(network)]}
    write_tensors(path, state, {**fixed, **metadata})


def kind_of(path):
    """Which of FORMATS a weight file or a checkpoint is of."""
    names = torch.load(path, map_location="cpu")["average"] if str(path).endswith(".pt") else read_tensors(path)[0]
    return layers_model.Layered if "partition.context.weight" in names else model.Compositional


def load_model(path, kind=model.Compositional):
    """The model of a weight file or of a checkpoint, ready to denoise."""
    if str(path).endswith(".pt"):
        saved = torch.load(path, map_location="cpu")
        width, state = saved["width"], saved["average"]
    else:
        tensors, metadata = read_tensors(path)
        expected = FORMATS[kind]
        if any(metadata.get(name) != value for name, value in expected.items()):
            raise ValueError(f"{path}: expected {expected}, found {metadata}")
        width, state = int(metadata["width"]), {name: torch.from_numpy(x) for name, x in tensors.items()}
    network = kind(width)
    network.load_state_dict(state)
    return network.eval()
