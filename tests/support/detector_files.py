"""ONNX files of detectors: with given outputs, or that detect colours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from onnx import TensorProto, checker, helper, numpy_helper, save_model

Output = tuple[np.ndarray, np.ndarray]
"""Constant part of an output, and [3,...] what is multiplied with the mean of each channel."""


def write_constant(path: Path, outputs: Sequence[Output], width: int, height: int) -> None:
    """Write a network whose outputs are a constant plus the means of the channels of its input."""
    nodes = [helper.make_node("ReduceMean", ["image"], ["means"], axes=[2, 3], keepdims=1)]
    nodes.append(helper.make_node("Split", ["means"], ["m0", "m1", "m2"], axis=1))
    constants, infos = [], []
    for number, (constant, factors) in enumerate(outputs):
        name = f"output_{number}"
        constants.append(numpy_helper.from_array(constant.astype(np.float32), f"{name}_c"))
        last = f"{name}_c"
        for channel in range(3):
            # [1,1,1,1], which broadcasts to any shape after the reshape to a scalar.
            factor, scaled = f"{name}_f{channel}", f"{name}_s{channel}"
            constants.append(numpy_helper.from_array(factors[channel].astype(np.float32), factor))
            nodes.append(helper.make_node("Squeeze", [f"m{channel}"], [f"{scaled}_m"]))
            nodes.append(helper.make_node("Mul", [factor, f"{scaled}_m"], [scaled]))
            total = name if channel == 2 else f"{name}_t{channel}"
            nodes.append(helper.make_node("Add", [last, scaled], [total]))
            last = total
        infos.append(helper.make_tensor_value_info(name, TensorProto.FLOAT, constant.shape))
    _save(path, nodes, constants, infos, (1, 3, height, width))


def write_color_detector(path: Path, colors: Sequence[tuple[int, int, int]], side_px: int) -> None:
    """Write a detector of colours in FastestDet's layout, with boxes of 0.16 of the image.

    Args:
        path: The ONNX file.
        colors: RGB of each class.
        side_px: Side of the square input.
    """
    cells = side_px // 16
    # Scores fall from 1 to 0 at a distance of chromaticity of 0.1, whatever the light.
    nodes = [
        helper.make_node(
            "AveragePool", ["image"], ["cell"], kernel_shape=[16, 16], strides=[16, 16]
        ),
        helper.make_node("ReduceSum", ["cell", "channels"], ["sum"]),
        helper.make_node("Div", ["cell", "sum"], ["mean"]),
    ]
    constants, scores = [], []
    for number, color in enumerate(colors):
        bgr = np.array(color[::-1], np.float32).reshape(1, 3, 1, 1) / sum(color)
        constants.append(numpy_helper.from_array(bgr, f"color_{number}"))
        nodes += [
            helper.make_node("Sub", ["mean", f"color_{number}"], [f"difference_{number}"]),
            helper.make_node(
                "ReduceL2", [f"difference_{number}"], [f"distance_{number}"], axes=[1]
            ),
            helper.make_node("Mul", [f"distance_{number}", "slope"], [f"loss_{number}"]),
            helper.make_node("Sub", ["unit", f"loss_{number}"], [f"raw_{number}"]),
            helper.make_node("Clip", [f"raw_{number}", "zero", "most"], [f"score_{number}"]),
        ]
        scores.append(f"score_{number}")
    head = np.zeros((1, 5, cells, cells), np.float32)
    head[:, 0] = 1
    head[:, 1:3] = np.arctanh(0.5)  # Middle of the cell.
    head[:, 3:5] = np.log(0.16 / 0.84)
    for name, value in (("slope", 10.0), ("unit", 1.0), ("zero", 0.0), ("most", 0.95)):
        constants.append(numpy_helper.from_array(np.array(value, np.float32), name))
    constants.append(numpy_helper.from_array(head, "head"))
    constants.append(numpy_helper.from_array(np.array([1], np.int64), "channels"))
    nodes.append(helper.make_node("Concat", ["head", *scores], ["output"], axis=1))
    shape = (1, 5 + len(colors), cells, cells)
    info = helper.make_tensor_value_info("output", TensorProto.FLOAT, shape)
    _save(path, nodes, constants, [info], (1, 3, side_px, side_px))


def _save(
    path: Path, nodes: list, constants: list, outputs: list, input_shape: tuple[int, ...]
) -> None:
    image = helper.make_tensor_value_info("image", TensorProto.FLOAT, input_shape)
    graph = helper.make_graph(nodes, "detector", [image], outputs, constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    checker.check_model(model)
    save_model(model, path)
