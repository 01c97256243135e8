"""Data sets in the format of nerfstudio: frames, angles of view, lenses, and rejected files."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree

from gslts.datasets import open_dataset
from gslts.datasets.dataset import join_reasons
from gslts.datasets.undistort import Lens, undistort_depth


def test_nerfstudio_comes_back_as_it_was_seen(recorded: Path) -> None:
    dataset = open_dataset(recorded)
    assert dataset.name == "room"
    assert dataset.skipped == ()
    assert_frames_agree([frame.read() for frame in dataset.frames])
    for frame, expected in zip(dataset.frames, frames_of_robot(), strict=True):
        read = frame.read()
        np.testing.assert_array_equal(read.rgb, expected.rgb)
        np.testing.assert_allclose(read.depth, expected.depth, atol=0.00051)
        assert read.labels is not None
        assert expected.labels is not None
        np.testing.assert_array_equal(read.labels.instances, expected.labels.instances)
        assert read.labels.types == expected.labels.types
        assert set(read.labels.types) == {"Block", "Wall"}
        pose, true_pose = (f.camera.world_from_camera for f in (read, expected))
        np.testing.assert_allclose(pose, true_pose, atol=1e-12)
        for name in ("fx", "fy", "cx", "cy", "width", "height"):
            assert getattr(read.camera, name) == pytest.approx(getattr(expected.camera, name))


def edited(folder: Path, edit: object) -> Path:
    content = json.loads((folder / "transforms.json").read_text())
    edit(content)
    (folder / "transforms.json").write_text(json.dumps(content))
    return folder


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c["frames"][1].pop("file_path"), r"frames\[1\]: file_path: Field required"),
        (lambda c: c["frames"].__setitem__(1, 7), r"frames\[1\]: expected an object, got 7"),
        (
            lambda c: c["frames"][1]["transform_matrix"][0].__setitem__(0, float("nan")),
            r"frames\[1\]: transform_matrix\.0\.0: .*finite",
        ),
        (
            lambda c: c["frames"][1]["transform_matrix"][0].__setitem__(0, 9.0),
            r"frames\[1\]: the pose is not rigid",
        ),
        (lambda c: c["frames"][1].update(k4=0.1), r"frames\[1\]: k4: 0\.1 is for fisheyes only"),
        (lambda c: c["frames"][1].update(fl_x=-3), r"frames\[1\]: .*f"),
        (
            lambda c: c["frames"][1].update(fl_x=0.9),
            r"frames\[1\]: a focal length of 0\.9 px does not fit an image of 64 x 48 px",
        ),
        (
            lambda c: c["frames"][1].update(cx=64.5),
            r"frames\[1\]: the principal point \(64\.5, 24\) is outside the image of 64 x 48 px",
        ),
    ],
)
def test_bad_frames_are_skipped_and_named(recorded: Path, edit: object, message: str) -> None:
    import re

    dataset = open_dataset(edited(recorded, edit))
    assert len(dataset.frames) == 2
    (reason,) = dataset.skipped
    assert re.search(message, reason), reason
    assert "\n" not in reason


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda c: c.pop("frames"), r"transforms\.json: frames: Field required"),
        (lambda c: c.update(frames=c["frames"][:1]), "1 usable frames, at least 2 are needed"),
        (lambda c: c.update(camera_model="EQUIRECTANGULAR"), "EQUIRECTANGULAR is not supported"),
        (lambda c: c.update(fl_x="wide"), r"transforms\.json: fl_x: "),
    ],
)
def test_bad_data_sets_are_rejected(recorded: Path, edit: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        open_dataset(edited(recorded, edit))


BAD_ANGLES = [0, float("nan"), -1.5, 3.2, "wide", "0.9", True, 1e300, 10**400, 1e-323]


def without_focal_length(content: dict) -> None:
    for part in (content, *content["frames"]):
        for name in ("fl_x", "fl_y"):
            part.pop(name, None)


def test_nerfstudio_with_the_angle_of_view(recorded: Path) -> None:
    def edit(content: dict) -> None:
        without_focal_length(content)
        content["camera_angle_x"] = 1.2

    camera = open_dataset(edited(recorded, edit)).frames[0].camera
    assert camera.fx == camera.fy == pytest.approx(32 / np.tan(0.6))


@pytest.mark.parametrize("angle", BAD_ANGLES, ids=lambda angle: repr(angle)[:8])
def test_invalid_angles_of_view_are_rejected(recorded: Path, angle: object) -> None:
    def edit(content: dict) -> None:
        without_focal_length(content)
        content["camera_angle_x"] = angle

    edited(recorded, edit)
    with pytest.raises(ValueError, match=r"transforms\.json: camera_angle_x: .*, got ") as caught:
        open_dataset(recorded)
    assert str(caught.value).endswith(f", got {angle!r:.40}")


@pytest.mark.parametrize("angle", BAD_ANGLES, ids=lambda angle: repr(angle)[:8])
def test_an_angle_of_view_that_is_none_is_skipped(recorded: Path, angle: object) -> None:
    edited(recorded, lambda c: c["frames"][1].update(camera_angle_x=angle))
    (reason,) = open_dataset(recorded).skipped
    assert reason.startswith("frames[1]: camera_angle_x: Input should be ")


@pytest.mark.parametrize("name", ["w", "h"])
def test_image_sizes_that_are_no_numbers_are_rejected(recorded: Path, name: str) -> None:
    def edit(content: dict) -> None:
        for part in (content, *content["frames"]):
            part.pop("cx", None)
            part.pop("cy", None)
        content["frames"][1].update({"w": 64, "h": 48, name: 10**400})

    (reason,) = open_dataset(edited(recorded, edit)).skipped
    assert reason.startswith(f"frames[1]: {name}: Input should be less than or equal to 65536, got")
    assert len(reason) < 120


@pytest.mark.parametrize("unit", [0, -0.001])
def test_invalid_units_of_depth_are_rejected(recorded: Path, unit: float) -> None:
    edited(recorded, lambda c: c.update(depth_unit_scale_factor=unit))
    with pytest.raises(ValueError, match=r"json: depth_unit_scale_factor: .*greater than 0, got"):
        open_dataset(recorded)


def test_paths_that_name_no_file_are_skipped(recorded: Path) -> None:
    def edit(content: dict) -> None:
        for entry in content["frames"][1:]:
            entry.update(file_path="/", w=64, h=48)
        content["frames"].append(content["frames"][0])

    dataset = open_dataset(edited(recorded, edit))
    assert dataset.skipped == tuple(
        f"frames[{k}]: the name '/' of an image leads out of the data set" for k in (1, 2)
    )


def test_missing_images_are_skipped_and_named(recorded: Path) -> None:
    def edit(content: dict) -> None:
        gone = [{**content["frames"][0], "file_path": f"images/{k}.png"} for k in range(17)]
        content["frames"] += gone

    edited(recorded, edit)
    (recorded / "depth/00001.png").unlink()
    dataset = open_dataset(recorded)
    assert [frame.name for frame in dataset.frames] == ["00000", "00002"]
    assert dataset.skipped == ()
    assert dataset.missing[0] == "depth/00001.png: there is no such depth image"
    assert len(dataset.missing) == 18
    assert join_reasons(dataset.left_out) == [
        "17 frames (images/0.png, images/1.png, images/2.png, ...): there is no such image",
        "depth/00001.png: there is no such depth image",
    ]
    (recorded / "depth/00002.png").unlink()
    with pytest.raises(
        ValueError, match=r"1 usable frames, .*; 17 frames \(images/0.png, .*\): th"
    ):
        open_dataset(recorded)


def test_images_outside_of_the_folder_are_not_read(recorded: Path) -> None:
    secret = recorded.parent / "secret.png"
    secret.write_bytes((recorded / "images/00001.png").read_bytes())
    for name in ("../secret.png", "images/../../secret.png", str(secret)):
        edited(recorded, lambda c, name=name: c["frames"][1].update(file_path=name))
        (reason,) = open_dataset(recorded).skipped
        assert reason == f"frames[1]: the name {name[:80]!r} of an image leads out of the data set"


def test_labels_outside_of_the_folder_are_not_read(recorded: Path) -> None:
    secret = recorded.parent / "secret.png"
    secret.write_bytes((recorded / "instances/00001.png").read_bytes())
    for name in ("../secret.png", str(secret)):
        edited(recorded, lambda c, name=name: c["frames"][1].update(instance_file_path=name))
        (reason,) = open_dataset(recorded).skipped
        assert reason == f"frames[1]: the name {name[:80]!r} of an image leads out of the data set"
    edited(recorded, lambda c: c["frames"][1].update(instance_file_path="gone.png"))
    assert open_dataset(recorded).frames[1].read().labels is None


def test_nerfstudio_has_lenses(recorded: Path) -> None:
    edited(recorded, lambda c: c.update(k1=-0.1, k2=0.02, p1=0.001, p2=0.002, k3=0.003))
    assert open_dataset(recorded).frames[0].lens == Lens((-0.1, 0.02, 0.001, 0.002, 0.003))
    edited(recorded, lambda c: c.update(camera_model="OPENCV_FISHEYE", k4=0.004))
    frame = open_dataset(recorded).frames[0]
    assert frame.lens == Lens((-0.1, 0.02, 0.003, 0.004), fisheye=True)
    assert frame.read().mask is not None
    edited(recorded, lambda c: c.update(camera_model="OPENCV", is_fisheye=True))
    assert open_dataset(recorded).frames[0].lens == frame.lens, "as instant-ngp writes it"
    edited(recorded, lambda c: c["frames"][1].update(is_fisheye=False, k4=0))
    lenses = [frame.lens for frame in open_dataset(recorded).frames]
    assert lenses[1] == Lens((-0.1, 0.02, 0.001, 0.002, 0.003))
    assert lenses[2] == frame.lens


def write_masks(folder: Path) -> np.ndarray:
    """Write a mask of all frames, as nerfstudio reads it: the left half and a pixel are 0."""
    mask = np.full((48, 64), 255, np.uint8)
    mask[:, :32] = 0
    mask[7, 40] = 0
    Image.fromarray(mask).save(folder / "mask.png")

    def edit(content: dict) -> None:
        for entry in content["frames"]:
            entry["mask_path"] = "mask.png"

    edited(folder, edit)
    return mask > 0


def test_masked_pixels_are_not_used(recorded: Path) -> None:
    mask = write_masks(recorded)
    frame = open_dataset(recorded).frames[0].read()
    np.testing.assert_array_equal(frame.mask, mask)
    assert frame.depth[~mask].any()
    assert not frame.registered().depth[~mask].any()
    edited(recorded, lambda c: c.update(k1=0.3))
    distorted = open_dataset(recorded).frames[0].read()
    edited(recorded, lambda c: [entry.pop("mask_path") for entry in c["frames"]])
    border = open_dataset(recorded).frames[0].read().mask
    assert border is not None
    assert distorted.mask is not None
    assert not border.all()
    assert not (distorted.mask & ~border).any()
    assert not distorted.mask[:, :32].any(), "the principal point is in column 32"
    assert (border & ~distorted.mask)[:, 34:].sum() == 1, "the pixel moves with the lens"


def test_frames_with_and_without_poses_keep_their_order(recorded: Path) -> None:
    def lose_some(content: dict) -> None:
        for k, frame in enumerate(content["frames"]):
            image = recorded / frame["file_path"]
            frame["file_path"] = f"images/{8 + k}{image.suffix}"
            image.rename(recorded / frame["file_path"])
        del content["frames"][1]["transform_matrix"]

    dataset = open_dataset(edited(recorded, lose_some), posed=False)
    assert [frame.name for frame in dataset.frames] == ["8", "9", "10"]
    assert [frame.name for frame in dataset.unposed] == ["9"]


def test_masks_that_cannot_be_used_are_named(recorded: Path) -> None:
    write_masks(recorded)
    Image.new("L", (32, 24)).save(recorded / "mask.png")
    with pytest.raises(ValueError, match=r"mask\.png: 32 x 24 px, expected 64 x 48 px"):
        open_dataset(recorded).frames[0].read()
    Image.new("RGB", (64, 48)).save(recorded / "mask.png")
    with pytest.raises(ValueError, match=r"mask\.png: 3 uint8 per pixel, expected one integer"):
        open_dataset(recorded).frames[0].read()
    edited(recorded, lambda c: c["frames"][1].update(mask_path="gone.png"))
    assert open_dataset(recorded).missing == ("gone.png: there is no such mask",)
    edited(recorded, lambda c: c["frames"][1].update(mask_path="../mask.png"))
    (reason,) = open_dataset(recorded).skipped
    assert reason == "frames[1]: the name '../mask.png' of an image leads out of the data set"


def test_depth_of_another_size(recorded: Path) -> None:
    for path in (recorded / "depth").iterdir():
        with Image.open(path) as image:
            small = image.resize((32, 24), Image.Resampling.NEAREST)
        small.save(path)
    dataset = open_dataset(recorded)
    assert dataset.left_out == ()
    frames = [frame.read() for frame in dataset.frames]
    assert_frames_agree(frames)
    depth_camera = frames[0].depth_camera
    assert depth_camera is not None
    assert (depth_camera.width, depth_camera.height) == (32, 24)
    assert depth_camera.fx == pytest.approx(frames[0].camera.fx / 2)
    edited(recorded, lambda c: c.update(k1=0.3))
    distorted = open_dataset(recorded).frames[0].read()
    np.testing.assert_array_equal(
        distorted.depth, undistort_depth(frames[0].depth, depth_camera, Lens((0.3, 0, 0, 0, 0)))
    )
