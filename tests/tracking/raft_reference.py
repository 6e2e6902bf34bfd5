#!/usr/bin/env python3
"""Reference values for tests/tracking/raft_test.cpp from torchvision's RAFT, with weights and images made by formulas.

Writes raft_names.txt beside this file (torchvision's names and shapes) and prints flows; made with torchvision 0.14.1.
"""
import math
import pathlib
import re

import torch
from torchvision.models.optical_flow import raft_large, raft_small

HEIGHT, WIDTH, ITERATIONS = 128, 136, 4
PIXELS = [(3, 5), (64, 68), (100, 20), (40, 130), (127, 135)]

# torchvision's names to those of raft/network.h, for the seeds.
RENAMES = [
    (r"^feature_encoder", "fnet"), (r"^context_encoder", "cnet"), (r"net\.conv\.", "net.conv2."),
    (r"convnormrelu\.0", "conv1"), (r"convnormrelu\.1", "norm1"), (r"convnormrelu(\d)\.0", r"conv\1"),
    (r"convnormrelu(\d)\.1", r"norm\1"), (r"motion_encoder\.conv\.0", "encoder.conv"),
    (r"motion_encoder\.conv(.)\w+(\d)\.0", r"encoder.conv\1\2"),
    (r"recurrent_block\.convgru(\d)\.(conv.)", r"gru.\g<2>\g<1>"),
    (r"mask_predictor\.convrelu\.0", "update_block.mask.0"), (r"mask_predictor\.conv", "update_block.mask.2"),
]


def network_name(name):
    for pattern, text in RENAMES:
        name = re.sub(pattern, text, name)
    return name


def made_up(name, shape):
    seed = sum((i + 1) * ord(c) for i, c in enumerate(name)) % 1009
    count = math.prod(shape)
    wave = torch.sin(torch.arange(count, dtype=torch.float64) * 2.399 + seed)
    if "running_var" in name or (".norm" in name or "downsample.1" in name) and name.endswith("weight"):
        values = 1 + 0.3 * wave
    elif len(shape) == 4:
        values = wave * math.sqrt(2.0 / (count / shape[0]))
    else:
        values = 0.1 * wave
    return values.reshape(shape).to(torch.float32)


def image(shift):
    y = torch.arange(HEIGHT, dtype=torch.float64).view(1, -1, 1)
    x = torch.arange(WIDTH, dtype=torch.float64).view(1, 1, -1)
    c = torch.arange(3, dtype=torch.float64).view(-1, 1, 1)
    u, v = x - 3 * shift, y + 2 * shift
    value = torch.sin(0.21 * u + 0.13 * v + c) + torch.sin(0.17 * v - 0.07 * u + 2 * c) + torch.sin(0.5 * u) * torch.sin(0.4 * v)
    return (value / 3).to(torch.float32).unsqueeze(0)


def main():
    lines = []
    for title, make in (("small", raft_small), ("large", raft_large)):
        network = make(weights=None).eval()
        state = network.state_dict()
        for name, tensor in state.items():
            lines.append(" ".join([title, name] + [str(n) for n in tensor.shape]))
            if not name.endswith("num_batches_tracked"):
                state[name] = made_up(network_name(name), tuple(tensor.shape))
        network.load_state_dict(state)
        with torch.no_grad():
            flow = network(image(0), image(1), num_flow_updates=ITERATIONS)[-1][0]
        for row, column in PIXELS:
            print(title, row, column, "%.6f %.6f" % tuple(flow[:, row, column].tolist()))
    path = pathlib.Path(__file__).parent / "raft_names.txt"
    path.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
