"""Seconds and memory of DetectoRS on one photo and one core, its weights random.

    python scripts/time_detectors.py PHOTO

The work is that of the trained network but for the objects: with random weights it always finds the most
that it may find, 100, and draws a mask of each. Needs `cadpose[detectors]` and `cadpose detectors setup`.
"""

import resource
import sys
import time
from pathlib import Path

import torch

from cadpose.detection.mmdet.model import Htc
from cadpose.photos import read_photo

torch.set_num_threads(1)
photo = read_photo(Path(sys.argv[1]))
network = Htc()
for part in network.module.modules():
    if hasattr(part, "weight_gamma"):  # as built, its standardised kernels overflow
        part.weight_gamma.fill_(float(part.weight[0].numel()) ** -0.5)
wall, cpu = time.perf_counter(), time.process_time()
found = network.instances(photo.rgb)
print(f"{photo.width} x {photo.height}: {len(found)} objects")
print(f"{time.process_time() - cpu:.1f} s of one core, {time.perf_counter() - wall:.1f} s by the clock")
print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.1f} GiB at most")
