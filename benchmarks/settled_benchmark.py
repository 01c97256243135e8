"""Rate of settled updates: the detector reports nothing there, and no further version follows.

    python benchmarks/settled_benchmark.py                        # 20 seeds, 3 kinds, 2 rooms
    python benchmarks/settled_benchmark.py --seeds 0:4 --rooms block

A robot runs a round after a change and updates the map. Then (a) the detector compares the map with
new frames of the region, and (b) the robot runs a second round. The seed of a case selects the
noise of all frames after the mapping, and the new position of an object. Each room is mapped
several times with different noise, and the cases use these maps in turn. Rooms and images are
small: a case takes some seconds.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from tqdm import tqdm

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.datasets import open_dataset
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import render
from gslts.store.map_folder import open_map, write_map_folder
from gslts.update.config import CollectConfig, EditConfig, RefineConfig, UpdateConfig
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.robot_body import Viewpoint

KINDS = ("removal", "addition", "relocation")
"""Types of changes."""
WIDTH, HEIGHT = 160, 120
"""Size of the images, px."""
MAX_FRAMES, MAX_VIEWPOINTS = 48, 8
"""Maximum number of frames of the recording, and of viewpoints of a round."""
VIEWS, DISTANCE_M = 6, 1.3
"""Number of new frames around a change, and their distance, m."""
NEAR_M = 0.15
"""Maximum distance from the box of an object to a report of it, m."""
MAPPING = MappingConfig(
    iterations=1000,
    patience=1.0,
    rough_epochs=0,
    voxel_m=0.03,
    coarse_share=0.3,
    variant_steps=0,
    refine_poses=False,
    refine_lenses=False,
    threads=1,
)
UPDATE = UpdateConfig(
    collect=CollectConfig(distance_m=1.0),
    edit=EditConfig(voxel_m=0.02),  # Small images do not resolve more.
    refine=RefineConfig(margin_px=15),
    threads=1,
)
SQUARE_M, SQUARES = 0.25, 20
"""Edge of the squares of random colours on walls and floor, m, and their number per period."""

Box = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Lower and upper corner, m."""


@dataclass(frozen=True)
class Layout:
    """A room with a block, on which two objects stand and a third one has space.

    Attributes:
        size: Size of the room, m.
        block: Lower and upper corner of the block, m.
        positions: Centres of the two objects on the block, x and y, m.
        free: Box on the block for the centre of a third object, x and y, m.
        object_size: Size of an object, m.
    """

    size: tuple[float, float, float]
    block: Box
    positions: tuple[tuple[float, float], tuple[float, float]]
    free: tuple[tuple[float, float], tuple[float, float]]
    object_size: tuple[float, float, float]

    def box_at(self, x: float, y: float) -> Box:
        """Return the box of an object with its centre at a position."""
        (width, depth, height), z = self.object_size, self.block[1][2]
        low = (x - width / 2, y - depth / 2, z)
        return low, (x + width / 2, y + depth / 2, z + height)


LAYOUTS = {
    "block": Layout(
        size=(5.0, 4.0, 2.6),
        block=((2.0, 1.5, 0.0), (3.2, 2.3, 0.75)),
        positions=((2.2, 1.85), (3.0, 1.95)),
        free=((2.55, 1.66), (2.65, 2.1)),
        object_size=(0.24, 0.24, 0.3),
    ),
    "sideboard": Layout(  # At a wall, so that the backs of objects are never visible.
        size=(4.4, 4.8, 2.5),
        block=((3.8, 1.4, 0.0), (4.4, 3.2, 0.6)),
        positions=((4.1, 1.65), (4.05, 2.95)),
        free=((4.0, 2.1), (4.2, 2.5)),
        object_size=(0.3, 0.2, 0.22),
    ),
}
RED, BLUE, YELLOW = (200, 40, 30), (30, 60, 200), (230, 200, 30)
"""Colours of the objects, sRGB."""


def box_object(name: str, box: Box, texture: np.ndarray, *, inward: bool = False) -> HomeObject:
    """Return a box, or the walls around it, with a texture [H,W,3]."""
    corners = np.array(box)
    middle = np.array([*corners.mean(axis=0)[:2], corners[0, 2]])
    corners = corners - middle
    vertices, faces, uvs = [], [], []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, 1):
            quad = np.empty((4, 3))
            quad[:, axis] = corners[side, axis]
            quad[:, a], quad[:, b] = corners[[0, 1, 1, 0], a], corners[[0, 0, 1, 1], b]
            order = np.array([[0, 1, 2], [0, 2, 3]])
            order = order if (side == 1) != inward else order[:, ::-1]
            faces.append(order + 4 * len(vertices))
            uvs.append((quad[:, [a, b]] - quad[0, [a, b]])[order] / (SQUARE_M * SQUARES))
            vertices.append(quad)
    surface = Surface(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(uvs).astype(np.float32),
        texture,
    )
    pose = np.eye(4)
    pose[:3, 3] = middle
    solid = np.array([corners])
    if inward:  # Walls and ceiling; the floor is an object of its own.
        thick = np.tile(corners, (5, 1, 1))
        for k, (axis, side) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1), (2, 1))):
            edge = corners[side, axis]
            thick[k, :, axis] = (edge - 0.1, edge) if side == 0 else (edge, edge + 0.1)
        solid = thick
    return HomeObject(name, name.split("|")[0], (surface,), solid, pose)


def squares(seed: int, darkest: int) -> np.ndarray:
    """Return a texture of squares in random colours, without repetition."""
    colors = np.random.default_rng(seed).integers(darkest, 220, (SQUARES, SQUARES, 3))
    return colors.astype(np.uint8).repeat(16, 0).repeat(16, 1)


def make_object(layout: Layout, name: str, x: float, y: float, color: Sequence[int]) -> HomeObject:
    """Return an object of one colour on the block."""
    plain = np.full((4, 4, 3), color, np.uint8)
    return replace(box_object(name, layout.box_at(x, y), plain), movable=True, parent="Block|1")


def home_of(layout: Layout) -> Home:
    """Return the room as it is mapped."""
    (x, y, z), first = layout.size, 100 * list(LAYOUTS.values()).index(layout)
    # The walls extend below the floor, so that no two surfaces coincide.
    walls = box_object("Wall|1", ((0, 0, -0.2), (x, y, z)), squares(first, 40), inward=True)
    floor = box_object("Floor|1", ((0, 0, -0.1), (x, y, 0)), squares(first + 1, 90))
    block = box_object("Block|1", layout.block, squares(first + 2, 110))
    (red, blue) = layout.positions
    return Home(
        name="settled",
        rooms=(Room("kitchen", np.array([[0, 0, 0], [x, y, z]])),),
        objects=(
            walls,
            replace(floor, receptacle=True),
            replace(block, receptacle=True, parent="Floor|1"),
            make_object(layout, "Box|1", *red, RED),
            make_object(layout, "Box|2", *blue, BLUE),
        ),
        lights=(
            AreaLight(
                center=np.array([x / 2, y / 2, z - 0.01]),
                edge_u=np.array([0.0, 0.6, 0.0]),
                edge_v=np.array([0.6, 0.0, 0.0]),
                radiance=np.full(3, 20.0),
            ),
        ),
        ambient=np.full(3, 0.3),
    )


def change_home(layout: Layout, kind: str, seed: int) -> tuple[Home, list[Box]]:
    """Return the room after a change, and the boxes of removed and added objects."""
    home = home_of(layout)
    to = np.random.default_rng(seed).uniform(*layout.free).tolist()
    if kind == "removal":
        return home.without(["Box|1"]), [layout.box_at(*layout.positions[0])]
    if kind == "addition":
        new = make_object(layout, "Box|3", *to, YELLOW)
        return replace(home, objects=(*home.objects, new)), [layout.box_at(*to)]
    rest = home.without(["Box|2"])
    moved = replace(rest, objects=(*rest.objects, make_object(layout, "Box|2", *to, BLUE)))
    return moved, [layout.box_at(*layout.positions[1]), layout.box_at(*to)]


def robot_in(home: Home, seed: int) -> Controller:
    """Return a robot with a noisy camera."""
    return Controller(home, width=WIDTH, height=HEIGHT, noise="kinect", seed=seed)


def viewpoints_around(box: Box, robot: Controller) -> list[Viewpoint]:
    """Return viewpoints that face a box from all sides that the robot can reach."""
    middle = np.mean(box, axis=0)
    eye_m = float(robot.observe().camera.world_from_camera[2, 3])
    places = robot.reachable_positions()
    chosen = set()
    for turn_rad in 2 * np.pi * np.arange(VIEWS) / VIEWS + 0.2:
        wanted = middle[:2] + DISTANCE_M * np.array([np.cos(turn_rad), np.sin(turn_rad)])
        metres = np.linalg.norm(places - wanted, axis=1)
        if metres.min() < DISTANCE_M / 2:
            chosen.add(int(np.argmin(metres)))
    viewpoints = []
    for x, y in places[sorted(chosen)]:
        direction = middle[:2] - (x, y)
        down_deg = np.degrees(np.arctan2(eye_m - middle[2], np.linalg.norm(direction)))
        yaw_deg = np.degrees(np.arctan2(direction[1], direction[0]))
        viewpoints.append(Viewpoint(x, y, float(yaw_deg), float(down_deg)))
    return viewpoints


def write_map(home: Home, seed: int, folder: Path) -> None:
    """Map a home with the noise of a seed, unless the map exists."""
    if folder.exists():
        return
    with TemporaryDirectory() as visit:
        capture(robot_in(home, seed), explore(home, MAX_FRAMES)[0], Path(visit) / "visit")
        result = make_map(open_dataset(Path(visit) / "visit"), MAPPING)
    cameras = {name: frame.camera() for name, frame in result.training.items()}
    write_map_folder(folder, result.gaussian_map, {"dataset": "visit"}, cameras)


def is_at(point: np.ndarray, boxes: Sequence[Any]) -> bool:
    """Return whether a point (3,) is in or near a box."""
    corners = [np.array(box) for box in boxes]
    return any(((point >= low - NEAR_M) & (point <= high + NEAR_M)).all() for low, high in corners)


def run_case(layout: Layout, kind: str, seed: int, made: Path) -> dict[str, Any]:
    """Run two rounds after a change, and return the results."""
    home, boxes = change_home(layout, kind, seed)
    config = KeeperConfig(
        max_viewpoints=MAX_VIEWPOINTS, detection=DetectionConfig(halvings=0), update=UPDATE
    )
    log: list[str] = []
    start_s = time.process_time()
    with TemporaryDirectory() as name:
        folder = Path(name) / "map"
        shutil.copytree(made, folder)
        with MapKeeper(folder, config, log=log.append) as keeper:
            keeper.go_round(robot_in(home, 1_000_000 + seed))
            first, rest = keeper.version.number, len(log)
            detector = ChangeDetector.of_map(folder, config.detection)
            robot = robot_in(home, 2_000_000 + seed)
            confidences: list[float | None] = []
            errors = []
            for viewpoint in [
                viewpoint for box in boxes for viewpoint in viewpoints_around(box, robot)
            ]:
                robot.go(viewpoint)
                frame = robot.observe()
                found = detector.detect(frame).changes
                own = [change.confidence for change in found if is_at(change.point, boxes)]
                confidences.append(max(own, default=None))
                rgb = render(keeper.gaussian_map, frame.camera).rgb.clip(0, 1)
                errors.append(float(np.mean((rgb - frame.rgb / 255) ** 2)))
            keeper.go_round(robot_in(home, 3_000_000 + seed))
            second = keeper.version.number
        with open_map(folder) as store:
            known, late = (
                [
                    box
                    for event in store.events()
                    if low < event.version <= high
                    for box in event.boxes
                    if box
                ]
                for low, high in ((1, first), (first, second))
            )
    return {
        "kind": kind,
        "seed": seed,
        "made": all(any(is_at(np.mean(other, axis=0), [box]) for other in known) for box in boxes),
        "versions": [first, second],
        "reports": confidences,
        "anew": [is_at(np.mean(box, axis=0), boxes) for box in late],
        "psnr_db": psnr_from_mse_db(float(np.mean(errors))),
        "log": [log[:rest], log[rest:]],
        "cpu_s": round(time.process_time() - start_s, 1),
    }


def summary(cases: Sequence[dict[str, Any]]) -> list[str]:
    """Return a markdown table with a row for each room and kind, and a last one for all."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for case in cases:
        groups.setdefault((case["room"], case["kind"]), []).append(case)
    lines = [
        "| room | change | updated | views without a report there | cases without one "
        "| second rounds without a version there | without any | PSNR |",
        "| --- | --- | --: | --: | --: | --: | --: | --: |",
    ]
    for (room, kind), own in [*groups.items(), (("all", ""), list(cases))]:
        # A change that the first round did not integrate cannot be settled.
        made = [case for case in own if case["made"]]
        views = [report is None for case in made for report in case["reports"]]
        silent = [all(report is None for report in case["reports"]) for case in made]
        still = [case["versions"][0] == case["versions"][1] for case in made]
        kept = [not any(case["anew"]) for case in made]
        shares = " | ".join(share(answers) for answers in (views, silent, kept, still))
        psnr_db = np.mean([case["psnr_db"] for case in own])
        lines.append(
            f"| {room} | {kind} | {len(made)} of {len(own)} | {shares} | {psnr_db:.2f} dB |"
        )
    return lines


def share(answers: Sequence[bool]) -> str:
    """Return the number and the share of true values."""
    if not answers:
        return "-"
    return f"{sum(answers)} of {len(answers)} ({100 * np.mean(answers):.0f} %)"


def main() -> None:
    """Run all cases, and print the rates."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", default=list(LAYOUTS), choices=LAYOUTS)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--seeds", default="0:20", help="FIRST:END of the noise")
    parser.add_argument("--maps", type=int, default=4, help="maps per room, with different noise")
    parser.add_argument("--work", type=Path, default=Path("out/settled"), help="folder of the maps")
    parser.add_argument("--out", type=Path, default=Path("out/settled.json"))
    given = parser.parse_args()
    seeds = range(*map(int, given.seeds.split(":")))
    wanted = [(s, room, kind) for s in seeds for room in given.rooms for kind in given.kinds]
    cases: list[dict[str, Any]] = []
    for seed, room, kind in tqdm(wanted, desc="cases"):
        made = given.work / f"{room}_{seed % given.maps}"
        write_map(home_of(LAYOUTS[room]), seed % given.maps, made)
        cases.append({"room": room, **run_case(LAYOUTS[room], kind, seed, made)})
        given.out.parent.mkdir(parents=True, exist_ok=True)
        given.out.write_text(json.dumps(cases, indent=1) + "\n")
    print("\n".join(summary(cases)))


if __name__ == "__main__":
    main()
