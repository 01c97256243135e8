"""Detectors from files: layouts, letterboxes, colour order and masks; damaged and hostile files."""

import math
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from detector_files import Output, write_constant

from gslts.semantics.detector import Detections, Detector

MODELS = Path(__file__).parents[4] / "shared" / "data" / "models"
SIDE = 64
CELLS = 64 + 16 + 4
"""Cells of 8, 16 and 32 px of an image of 64 x 64 px; the fourth grid has one more."""
BOX = (8.0, 20.0, 40.0, 44.0)
"""The box that each network has, px of its input."""
CENTER, SIZE = (24.0, 32.0), (32.0, 24.0)
CLASSES = 3


def rows_to_output(
    rows: np.ndarray,
    score_columns: slice,
    scale: tuple[float, ...] = (1, 1, 1),
    bias: tuple[float, ...] = (0, 0, 0),
) -> Output:
    """Return rows [A,B], the first of which has the channel means as scores of its classes."""
    factors = np.zeros((3, *rows.shape))
    rows = rows.copy()
    for channel, column in enumerate(range(rows.shape[1])[score_columns]):
        factors[channel, 0, column] = scale[channel]
        rows[0, column] = bias[channel]
    return rows[None], factors[:, None]


def yolov5() -> Output:
    rows = np.zeros((3 * CELLS, 5 + CLASSES))
    rows[0, :5] = (*CENTER, *SIZE, 1)
    return rows_to_output(rows, slice(5, None))


def yolov8() -> Output:
    rows = np.zeros((CELLS, 4 + CLASSES))
    rows[0, :4] = (*CENTER, *SIZE)
    constant, factors = rows_to_output(rows, slice(4, None))
    return constant.transpose(0, 2, 1), factors.transpose(0, 1, 3, 2)


def at_cell(output: Output, row: int) -> Output:
    """Swap the first row with that of a cell."""
    order = np.arange(output[0].shape[1])
    order[[0, row]] = row, 0
    return output[0][:, order], output[1][:, :, order]


def yolox() -> Output:
    """In the cell of 16 px in column 1 and row 2."""
    rows = np.zeros((CELLS, 5 + CLASSES))
    rows[0, :5] = (24 / 16 - 1, 32 / 16 - 2, math.log(32 / 16), math.log(24 / 16), 1)
    return at_cell(rows_to_output(rows, slice(5, None), (1 / 255,) * 3), 64 + 2 * 4 + 1)


def nanodet(cells: int, middle: float) -> Output:
    """In the cell of 16 px in column 1 and row 2; distances between two bins."""
    rows = np.zeros((cells, CLASSES + 32))
    origin = (16 * (1 + middle), 16 * (2 + middle))
    distances = (origin[0] - BOX[0], origin[1] - BOX[1], BOX[2] - origin[0], BOX[3] - origin[1])
    for side, distance in enumerate(distances):
        low, share = int(distance // 16), distance / 16 % 1
        logits = np.full(8, -60.0)
        logits[low] = math.log(max(1 - share, 1e-20))
        logits[low + 1] = math.log(max(share, 1e-20))
        rows[0, CLASSES + 8 * side : CLASSES + 8 * side + 8] = logits
    mean, std = (103.53, 116.28, 123.675), (57.375, 57.12, 58.395)
    scale, bias = (tuple(x / 255 for x in values) for values in (std, mean))
    return at_cell(rows_to_output(rows, slice(0, CLASSES), scale, bias), 64 + 2 * 4 + 1)


def fastestdet() -> Output:
    rows = np.zeros((16, 5 + CLASSES))
    offsets = (24 / 16 - 1, 32 / 16 - 2)
    rows[0, :5] = (1, *(math.atanh(x) for x in offsets), 0, math.log(24 / 64 / (1 - 24 / 64)))
    constant, factors = at_cell(rows_to_output(rows, slice(5, None)), 2 * 4 + 1)
    image = (1, 4, 4, 5 + CLASSES)
    return (
        constant.reshape(image).transpose(0, 3, 1, 2),
        factors.reshape(3, *image).transpose(0, 1, 4, 2, 3),
    )


LAYOUTS: dict[str, tuple[Callable[[], Output], str]] = {
    "yolov5": (yolov5, "center"),
    "yolov8": (yolov8, "center"),
    "yolox": (yolox, "corner"),
    "nanodet": (lambda: nanodet(CELLS + 1, 0.0), "stretch"),
    "nanodet of three grids": (lambda: nanodet(CELLS, 0.5), "stretch"),
    "fastestdet": (fastestdet, "stretch"),
}


def colored(width: int, height: int) -> np.ndarray:
    """Return an image of one colour, more red than green than blue."""
    return np.full((height, width, 3), (220, 120, 20), np.uint8)


def detect(path: Path, output: Output, rgb: np.ndarray) -> tuple[Detector, Detections]:
    write_constant(path, [output], SIDE, SIDE)
    detector = Detector(path, CLASSES)
    return detector, detector(rgb)


@pytest.mark.parametrize("name", LAYOUTS)
def test_boxes_and_colors_of_each_layout(name: str, tmp_path: Path) -> None:
    """An image of 200 x 100 px in an input of 64 x 64 px."""
    make, fit = LAYOUTS[name]
    detector, found = detect(tmp_path / "net.onnx", make(), colored(200, 100))
    assert detector.layout == name.split()[0]
    left, top, right, bottom = BOX
    if fit == "stretch":
        expected = (left * 200 / 64, top * 100 / 64, right * 200 / 64, bottom * 100 / 64)
        means = (220, 120, 20)
    else:
        # 64 / 200 px per px; half of the input is grey, above and below or below the image.
        above = 16 if fit == "center" else 0
        expected = tuple(
            min((value - shift) * 200 / 64, limit)
            for value, shift, limit in zip(
                BOX, (0, above, 0, above), (200, 100, 200, 100), strict=True
            )
        )
        means = (167, 117, 67)
    assert len(found.boxes) == 1
    np.testing.assert_allclose(found.boxes[0], expected, atol=0.02)
    # Of the first channel, red or blue; the best class is that of the red channel.
    is_bgr = detector.layout in ("yolox", "nanodet", "fastestdet")
    assert found.classes.tolist() == [2 if is_bgr else 0]
    assert found.scores[0] == pytest.approx(max(means) / 255, abs=0.005)


@pytest.mark.parametrize("name", ["yolov5", "yolov8"])
def test_masks_are_those_of_the_prototypes(name: str, tmp_path: Path) -> None:
    """The first prototype is the left half of the input, of which the box has 24 px."""
    constant, factors = LAYOUTS[name][0]()
    axis = 2 if name == "yolov5" else 1
    more = np.zeros((1, 3 * CELLS, 2) if axis == 2 else (1, 2, CELLS))
    more[0, 0, 0] = 3.0
    prototypes = np.full((1, 2, 16, 16), -1.0)
    prototypes[:, 0, :, :8] = 1
    outputs = [
        (
            np.concatenate([constant, more], axis),
            np.concatenate([factors, np.zeros((3, *more.shape))], axis + 1),
        ),
        (prototypes, np.zeros((3, *prototypes.shape))),
    ]
    write_constant(tmp_path / "net.onnx", outputs, SIDE, SIDE)
    found = Detector(tmp_path / "net.onnx", CLASSES)(colored(64, 64))
    assert found.masks is not None
    expected = np.zeros((64, 64), bool)
    expected[20:44, 8:32] = True
    np.testing.assert_array_equal(found.masks[0], expected)


def test_overlapping_boxes_of_a_class_are_one_detection(tmp_path: Path) -> None:
    rows = np.zeros((CELLS, 4 + CLASSES))
    rows[:4] = [
        (24, 32, 32, 24, 0.9, 0, 0),
        (25, 32, 32, 24, 0.8, 0, 0),
        (24, 32, 32, 24, 0, 0.5, 0),
        (24, 32, 32, 24, 0.1, 0, 0),
    ]
    constant = rows.T[None]
    write_constant(tmp_path / "net.onnx", [(constant, np.zeros((3, *constant.shape)))], SIDE, SIDE)
    found = Detector(tmp_path / "net.onnx", CLASSES)(colored(64, 64))
    assert found.classes.tolist() == [0, 1]
    np.testing.assert_allclose(found.scores, (0.9, 0.5), atol=1e-6)


def constant_net(path: Path, constant: np.ndarray, width: int = SIDE, height: int = SIDE) -> Path:
    write_constant(path, [(constant, np.zeros((3, *constant.shape)))], width, height)
    return path


def test_the_number_of_classes_must_fit(tmp_path: Path) -> None:
    path = constant_net(tmp_path / "net.onnx", np.zeros((1, 4 + 90, CELLS)))
    with pytest.raises(
        ValueError, match=r"net\.onnx: it has 90 \(yolov8\) classes, but there are 89"
    ):
        Detector(path, 89)
    assert Detector(path, 90).layout == "yolov8"
    with pytest.raises(ValueError, match=r"its outputs \[1, 94, 84\] for .* not of yolov5"):
        Detector(path, 90, "yolov5")
    with pytest.raises(ValueError, match=r"--layout: expected one of yolov5, .*, got yolov9"):
        Detector(path, 90, "yolov9")


@pytest.mark.parametrize(
    "shape", [(1, 10), (1, 5, 90), (1, 4, CELLS), (2, 84, CELLS), (1, 3, 9, 9)]
)
def test_other_outputs_are_named(shape: tuple[int, ...], tmp_path: Path) -> None:
    path = constant_net(tmp_path / "net.onnx", np.zeros(shape))
    with pytest.raises(ValueError, match=r"its outputs \[.*\] for images of 64x64 are not of any"):
        Detector(path, 1 if shape[1] != 4 else 0)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_outputs_that_are_not_finite_are_rejected(value: float, tmp_path: Path) -> None:
    constant = np.zeros((1, 7, CELLS))
    constant[0, 5, 3] = value
    detector = Detector(constant_net(tmp_path / "net.onnx", constant), CLASSES)
    with pytest.raises(ValueError, match=r"net\.onnx: its outputs are not finite"):
        detector(colored(64, 64))


def test_scores_that_are_none_are_rejected(tmp_path: Path) -> None:
    constant = np.zeros((1, 7, CELLS))
    constant[0, 5, 3] = 17
    detector = Detector(constant_net(tmp_path / "net.onnx", constant), CLASSES)
    with pytest.raises(ValueError, match=r"scores of 0\.00 to 17\.00 are not of the layout yolov8"):
        detector(colored(64, 64))


def test_files_that_are_no_detectors_are_named(tmp_path: Path) -> None:
    path = tmp_path / "net.onnx"
    with pytest.raises(FileNotFoundError, match=r"net\.onnx"):
        Detector(path, CLASSES)
    path.write_bytes(b"no network at all")
    with pytest.raises(ValueError, match=r"net\.onnx: it is no ONNX model"):
        Detector(path, CLASSES)
    with path.open("wb") as file:
        file.truncate(2_000_000_000)  # Sparse: it takes no space.
    with pytest.raises(ValueError, match=r"net\.onnx: it has 2 GB or more"):
        Detector(path, CLASSES)
    with pytest.raises(IsADirectoryError):
        Detector(tmp_path, CLASSES)


def test_external_data_outside_of_its_folder_is_not_read(tmp_path: Path) -> None:
    import onnx
    from onnx import external_data_helper

    folder = tmp_path / "model"
    folder.mkdir()
    constant_net(folder / "net.onnx", np.zeros((1, 7, CELLS)))
    model = onnx.load(folder / "net.onnx")
    external_data_helper.convert_model_to_external_data(
        model, location="weights.bin", size_threshold=0
    )
    onnx.save_model(model, folder / "net.onnx")
    assert Detector(folder / "net.onnx", CLASSES).layout == "yolov8"
    shutil.move(folder / "weights.bin", tmp_path / "weights.bin")
    model = onnx.load(folder / "net.onnx", load_external_data=False)
    for tensor in model.graph.initializer:
        for entry in tensor.external_data:
            if entry.key == "location":
                entry.value = "../weights.bin"
    (folder / "net.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(ValueError, match=r"net\.onnx: it is no ONNX model: .*escapes"):
        Detector(folder / "net.onnx", CLASSES)


def test_darknet_needs_its_configuration(tmp_path: Path) -> None:
    weights = tmp_path / "net.weights"
    weights.write_bytes(bytes(100))
    with pytest.raises(FileNotFoundError, match=r"net\.cfg: it is missing; the weights of Darknet"):
        Detector(weights, CLASSES)
    cfg = tmp_path / "net.cfg"
    cfg.write_text("[net]\nwidth=100000\nheight=64\nchannels=3\n")
    with pytest.raises(ValueError, match=r"net\.cfg: expected images of 3 channels up to 4096 px"):
        Detector(weights, CLASSES)
    cfg.write_text("[net]\nwidth=64\nheight=64\nchannels=3\n[convolutional]\nfilters=9\nsize=3\n")
    with pytest.raises(ValueError, match=r"net\.weights: "):
        Detector(weights, CLASSES)


needs_models = pytest.mark.skipif(not MODELS.is_dir(), reason="shared/data/models is not there")


def real_image() -> np.ndarray:
    path = MODELS.parent / "7scenes" / "frame-000288.color.jpg"
    return np.ascontiguousarray(cv2.imread(str(path))[..., ::-1])


@needs_models
def test_darknet_detects_as_opencv_does() -> None:
    """OpenCV has its own decoding and suppression for Darknet."""
    path = MODELS / "yolo-fastest-1.1-xl.weights"
    found = Detector(path, 80)(real_image())
    model = cv2.dnn.DetectionModel(str(path), str(path.with_suffix(".cfg")))
    model.setInputParams(1 / 255, (320, 320), (0, 0, 0), True)
    classes, scores, boxes = model.detect(real_image()[..., ::-1].copy(), 0.3, 0.45)
    assert len(classes) >= 3
    is_clear = found.scores > 0.3
    assert sorted(found.classes[is_clear].tolist()) == sorted(classes.tolist())
    for number, score, (left, top, width, height) in zip(classes, scores, boxes, strict=True):
        best = np.flatnonzero(found.classes == number)
        closest = best[np.abs(found.scores[best] - score).argmin()]
        assert found.scores[closest] == pytest.approx(score, abs=1e-3)
        if left > 0 and top > 0:  # Else OpenCV moves the box into the image.
            expected = np.clip((left, top, left + width, top + height), 0, (640, 480) * 2)
            np.testing.assert_allclose(found.boxes[closest], expected, atol=2)


@needs_models
def test_fastestdet_detects_as_its_example_does() -> None:
    """By the description of its example for onnxruntime, cell by cell."""
    import onnxruntime

    path, image = MODELS / "FastestDet.onnx", real_image()
    found = Detector(path, 80)(image)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    small = cv2.resize(image[..., ::-1], (352, 352), interpolation=cv2.INTER_AREA)
    pixels = (small.transpose(2, 0, 1)[None] / 255).astype(np.float32)
    (output,) = session.run(None, {session.get_inputs()[0].name: pixels})
    expected = []
    for row in range(22):
        for column in range(22):
            objectness, x, y, width, height, *classes = output[0, :, row, column].tolist()
            score = objectness * max(classes)
            middle = (column + math.tanh(x)) / 22 * 640, (row + math.tanh(y)) / 22 * 480
            half = 320 / (1 + math.exp(-width)), 240 / (1 + math.exp(-height))
            box = (
                middle[0] - half[0],
                middle[1] - half[1],
                middle[0] + half[0],
                middle[1] + half[1],
            )
            expected.append((score, int(np.argmax(classes)), np.clip(box, 0, (640, 480) * 2)))
    best = max(expected, key=lambda item: item[0])
    assert found.scores[0] == pytest.approx(best[0], abs=0.01)
    assert found.classes[0] == best[1]
    np.testing.assert_allclose(found.boxes[0], best[2], atol=1)
    # Every detection is one of the cells'.
    for box, score, number in zip(found.boxes, found.scores, found.classes, strict=True):
        differences = [
            abs(score - other) + np.abs(box - where).max() / 100
            for other, kind, where in expected
            if kind == number
        ]
        assert min(differences) < 0.03


@needs_models
@pytest.mark.parametrize("model", ["yolo-fastest-1.1-xl.weights", "FastestDet.onnx"])
def test_detections_do_not_depend_on_the_number_of_threads(model: str) -> None:
    before = cv2.getNumThreads()
    try:
        results = []
        for threads in (1, 2, 4):
            cv2.setNumThreads(threads)
            found = Detector(MODELS / model, 80)(real_image())
            results.append((found.boxes.tobytes(), found.scores.tobytes()))
    finally:
        cv2.setNumThreads(before)
    assert len(set(results)) == 1
