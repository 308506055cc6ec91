"""What TensorFlow makes of DELF's graph, to compare our rebuilt network with.

Runs in an environment of its own, Python 3.11 with `pip install tensorflow-cpu==2.12.1 tf-slim==1.1.0`: later
TensorFlows have not the layers that TF-slim asks for, and cadpose needs a later NumPy.

Builds ResNet-50 with TF-slim's own code and the attention and extraction as DELF publishes them, gives every
variable made-up values that depend on its name's place in the alphabet, and writes into the given folder

    model/       the SavedModel, as DELF's archive has it
    pca/         the PCA as DatumProto files
    answers.npz  the image, and features, scores, places and descriptors at all scales

and prints the numbers that tests/similarity/delf/test_network.py holds ours against.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

import numpy as np
import tensorflow as tf
from tf_slim import layers
from tf_slim.nets import resnet_v1
from tf_slim.ops.arg_scope import arg_scope

SCALES = (0.25, 0.3536, 0.5, 0.7071, 1.0, 1.4142, 2.0)
tf1 = tf.compat.v1


def network(images):
    """(1, H, W, 3) to attention and features."""
    block = resnet_v1.resnet_v1_block
    blocks = [
        block("block1", base_depth=64, num_units=3, stride=2),
        block("block2", base_depth=128, num_units=4, stride=2),
        block("block3", base_depth=256, num_units=6, stride=2),
    ]
    with arg_scope(resnet_v1.resnet_arg_scope()):
        _, ends = resnet_v1.resnet_v1(
            images, blocks, is_training=False, global_pool=False, scope="resnet_v1_50", reuse=tf1.AUTO_REUSE
        )
        features = ends["resnet_v1_50/block3"]
        with (
            arg_scope([layers.batch_norm], is_training=False),
            tf1.variable_scope("attention_block/attention/compute", reuse=tf1.AUTO_REUSE),
        ):
            hidden = layers.conv2d(features, 512, 1, activation_fn=tf.nn.relu, scope="conv1")
            score = layers.conv2d(hidden, 1, 1, activation_fn=None, normalizer_fn=None, scope="conv2")
    return tf.nn.softplus(score), features


def made_up(name, shape, rng):
    """Values that keep the activations of a deep network finite, drawn in the alphabet's order of names."""
    drawn = rng.random(shape)
    if name.endswith("/weights"):
        return (drawn - 0.5) * np.sqrt(24.0 / np.prod(shape[:3]))
    if name.endswith(("/gamma", "/moving_variance")):
        return 0.5 + drawn
    return (drawn - 0.5) * 0.2


def image(height, width):
    """A smooth picture with some colours and an edge."""
    y, x = np.mgrid[:height, :width]
    channels = [127.5 + 127.5 * np.sin(x / 17.0 + c) * np.cos(y / (11.0 + c)) for c in range(3)]
    picture = np.stack(channels, axis=2)
    picture[height // 3 : height // 2, width // 4 :] = (250.0, 40.0, 90.0)
    return np.rint(picture).astype(np.uint8)


def datum(array):
    """A DatumProto: shape with packed dimensions, packed floats."""

    def varint(n):
        return bytes([n]) if n < 128 else bytes([n & 127 | 128]) + varint(n >> 7)

    def part(number, data):
        return bytes([number << 3 | 2]) + varint(len(data)) + data

    shape = part(1, b"".join(varint(n) for n in array.shape))
    return part(1, shape) + part(2, part(1, struct.pack(f"<{array.size}f", *array.ravel())))


def main(folder: Path) -> None:
    tf1.disable_eager_execution()
    folder.mkdir(parents=True, exist_ok=True)
    images = tf1.placeholder(tf.float32, [None, None, 3], name="input_image")
    scale = tf1.placeholder(tf.float32, [])
    normalised = (images[None] - 128.0) / 128.0
    size = tf.cast(tf.round(tf.cast(tf.shape(images)[:2], tf.float32) * scale), tf.int32)
    shrunk = tf1.image.resize_bilinear(normalised, size)
    attention, features = network(shrunk)
    with tf1.Session() as session:
        rng = np.random.default_rng(0)
        for variable in sorted(tf1.global_variables(), key=lambda v: v.op.name):
            variable.load(made_up(variable.op.name, variable.shape.as_list(), rng), session)
        mean, matrix = rng.random(1024) * 0.05, rng.random((1024, 1024)) - 0.5
        (folder / "pca").mkdir(exist_ok=True)
        (folder / "pca" / "mean.datum").write_bytes(datum(mean.astype(np.float32)))
        (folder / "pca" / "pca_proj_mat.datum").write_bytes(datum(matrix.astype(np.float32)))
        builder = tf1.saved_model.builder.SavedModelBuilder(str(folder / "model"))
        builder.add_meta_graph_and_variables(session, [tf1.saved_model.tag_constants.SERVING])
        builder.save()

        for height, width in ((97, 130), (64, 33)):
            found, score = session.run(
                [features, attention], {images: image(height, width).astype(np.float32), scale: 1.0}
            )
            print(height, width, found.shape, found[0, ..., ::256].tolist(), score[0, ..., 0].tolist())
        tiny = np.arange(75, dtype=np.float32).reshape(5, 5, 3) ** 1.5
        for factor in (1.4, 0.6):
            print(
                factor, (128 * session.run(shrunk, {images: tiny, scale: factor})[0, :, :, 0] + 128).tolist()
            )

        picture = image(512, 512)
        told = [
            session.run([features, attention], {images: picture.astype(np.float32), scale: s}) for s in SCALES
        ]
        places, raw, scores = [], [], []
        for factor, (found, score) in zip(np.float32(SCALES), told, strict=True):
            y, x = np.mgrid[: found.shape[1], : found.shape[2]]
            corner = np.stack([y, x, y, x], axis=2).reshape(-1, 4) * 32.0 + (-145.0, -145.0, 145.0, 145.0)
            places.append(corner / factor)
            raw.append(found.reshape(-1, 1024))
            scores.append(score.ravel())
        boxes, raw, scores = (np.concatenate(a).astype(np.float32) for a in (places, raw, scores))
        least = float(np.quantile(scores, 0.2))
        kept = np.flatnonzero(scores >= least)
        best = kept[session.run(tf.image.non_max_suppression(boxes[kept], scores[kept], 1000, 1.0))]
        unit = tf.nn.l2_normalize(raw[best], axis=1)
        reduced = tf.matmul(unit - mean.astype(np.float32), matrix.astype(np.float32)[:40], transpose_b=True)
        descriptors = session.run(tf.nn.l2_normalize(reduced, axis=1))
        centres = (boxes[best, :2] + boxes[best, 2:]) / 2.0
        np.savez(
            folder / "answers.npz",
            image=picture,
            least=least,
            places=centres,
            scores=scores[best],
            descriptors=descriptors,
        )
        print(f"{len(scores)} features, {len(best)} kept, scores {scores.min()} to {scores.max()}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
