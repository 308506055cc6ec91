"""Which of the 1000 ImageNet classes show a library category."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0
from cadpose.geometry.boxes import Box
from cadpose.photos import crop_square

#: Library category -> indices in the usual order of the 1000 classes (sorted WordNet ids).
IMAGENET_INDICES: dict[str, tuple[int, ...]] = {
    # ambulance, station wagon, cab, convertible, jeep, limousine, minibus, minivan, Model T, pickup, police
    # van, racer, sports car
    "car": (407, 436, 468, 511, 609, 627, 654, 656, 661, 717, 734, 751, 817),
    # fire engine, garbage truck, moving van, tow truck, trailer truck
    "truck": (555, 569, 675, 864, 867),
    "bus": (779, 874),  # school bus, trolleybus
    "train": (466, 547, 705, 820, 829),  # bullet train, locomotives, passenger car, streetcar
    "boat": (472, 484, 510, 554, 576, 625, 628, 780, 814, 871, 914),
    "airplane": (404, 895),  # airliner, warplane
    "bicycle": (444, 671),  # tandem, mountain bike
    "motorbike": (665, 670),  # moped, motor scooter
    "chair": (423, 559, 765, 857),  # barber, folding, rocking chair, throne
    "bench": (703,),  # park bench
    "table": (526, 532, 736),  # desk, dining table, pool table
    "sofa": (831,),  # studio couch
    "bed": (431, 516, 520, 564),  # bassinet, cradle, crib, four-poster
    "cabinet": (492, 493, 495, 553, 648, 894),  # chest, chiffonier, china, file, medicine cabinet, wardrobe
    "bookcase": (453,),
    "lamp": (619, 846),  # lampshade, table lamp
    "piano": (579, 881),  # grand, upright
    "oven": (766, 827),  # rotisserie, stove
    "microwave": (651,),
    "fridge": (760,),
    "toaster": (859,),
    "dishwasher": (534,),
    "washing machine": (897,),
    "sink": (896,),  # washbasin
    "toilet": (861,),  # toilet seat
    "bathtub": (435, 876),  # bathtub, tub
    "bottle": (440, 720, 737, 898, 901, 907),  # beer, pill, pop, water bottle, whiskey jug, wine bottle
    "cup": (504, 968),  # coffee mug, cup
    "glass": (441, 572),  # beer glass, goblet
    "bowl": (659, 809),  # mixing, soup bowl
    "vase": (883,),
    "knife": (499,),  # cleaver
    "spoon": (618, 910),  # ladle, wooden spoon
    "clock": (409, 530, 826, 892),  # analog, digital clock, stopwatch, wall clock
    "watch": (531,),  # digital watch
    "bag": (414, 636, 728, 748),  # backpack, mailbag, plastic bag, purse
    "tv": (664, 782, 851),  # monitor, screen, television
    "laptop": (620, 681),  # laptop, notebook
    "keyboard": (508, 878),  # computer, typewriter keyboard
    "mouse": (673,),
    "phone": (487,),  # cellular telephone
    "telephone": (528, 707),  # dial telephone, pay-phone
    "remote": (761,),
    "camera": (732, 759),  # Polaroid, reflex
    "printer": (713, 742),  # photocopier, printer
    "speaker": (632,),
    "microphone": (650,),
    "fan": (545,),
    "hair drier": (589,),
    "plant": (738,),  # flowerpot
    "umbrella": (879,),
    "guitar": (402, 546),
    "helmet": (518, 560),  # crash, football helmet
    "cap": (515, 808),  # cowboy hat, sombrero
    "basket": (588, 790),  # hamper, shopping basket
    "trash bin": (412,),
    "mailbox": (637,),
    "pillow": (721,),
    "pistol": (763,),
    "rifle": (413, 764),
    "birdhouse": (448,),
    "ball": (429, 430, 522, 574, 722, 768, 805, 852, 890),
    "tennis racket": (752,),
    "teddy bear": (850,),
    "radiator": (753,),
}  # fmt: skip


#: Grey around a letterboxed crop: Lite0's zero.
GREY = 127


def classify(
    rgb: NDArray[np.uint8], box: Box, encoder: Lite0, categories: Collection[str] | None = None
) -> list[tuple[str, float]]:
    """Library categories of what a box shows, with their probabilities, best first.

    Args:
        rgb: (H, W, 3) uint8 photo.
        box: Rectangle in pixels of the photo.
        encoder: Lite0.
        categories: Those in question; None means all that ImageNet shows.
    """
    crop = crop_square(rgb, box, fill=GREY)
    found = category_probabilities(encoder.logits(crop[None]))[0]
    wanted = ((c, p) for c, p in found.items() if categories is None or c in categories)
    return sorted(wanted, key=lambda item: -item[1])


def category_probabilities(logits: NDArray[np.float32]) -> list[dict[str, float]]:
    """Softmax over the 1000 classes, summed into library categories.

    Args:
        logits: (N, 1000) ImageNet logits.

    Returns:
        N dictionaries category -> probability; what they leave to 1 belongs to no category.
    """
    z = np.exp(logits.astype(np.float64) - logits.max(axis=1, keepdims=True))
    z /= z.sum(axis=1, keepdims=True)
    return [{c: float(row[list(i)].sum()) for c, i in IMAGENET_INDICES.items()} for row in z]
