"""How often an update settles a change: the detector sees nothing there, and no version follows.

    python benchmarks/settled_benchmark.py                        # 20 seeds, 3 kinds, 2 rooms
    python benchmarks/settled_benchmark.py --seeds 0:4 --rooms block

A robot goes a round after a change and keeps the map up to date. Then (a) the detector compares the
map with new frames that look at the place, and (b) the robot goes a second round. The seed of a
case decides the noise of all frames after the mapping, and where an object comes to stand; each
room is mapped several times with other noise, and its cases take these maps in turn. The rooms are
small and plain, and so are the images: a case takes some seconds.
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
from gslts.keeper.keeper import LoopConfig, MapKeeper
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import render
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import open_map, write_map_folder
from gslts.update.config import CollectConfig, EditConfig, RefineConfig, UpdateConfig
from gslts_sim.capture import capture
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.robot_body import Viewpoint

KINDS = ("removal", "addition", "relocation")
WIDTH, HEIGHT = 160, 120
"""Of the images, px."""
FRAMES, STOPS = 48, 8
"""Of the recording that is mapped, and of a round, at most."""
VIEWS, AWAY_M = 6, 1.3
"""New frames that look at the place of a change, from all around it and so far away."""
NEAR_M = 0.15
"""A report so near to the place of an object counts as one at that place."""
MAPPING = MappingConfig(
    iterations=500,
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
    edit=EditConfig(voxel_m=0.02),  # Such small images do not resolve more.
    refine=RefineConfig(around_px=15),
    threads=1,
)
SQUARE_M, SQUARES = 0.25, 20
"""Of the random colours of walls and floor."""

Box = tuple[tuple[float, float, float], tuple[float, float, float]]


@dataclass(frozen=True)
class Place:
    """A room with a block in it, on which two things stand and a third one has room.

    Attributes:
        size: Of the room, m.
        block: Its lower and upper corner, m.
        things: Where the things stand on it, x and y of their middles, m.
        free: Box on the block where the middle of another one may be, x and y, m.
        thing: Its size, m.
    """

    size: tuple[float, float, float]
    block: Box
    things: tuple[tuple[float, float], tuple[float, float]]
    free: tuple[tuple[float, float], tuple[float, float]]
    thing: tuple[float, float, float]

    def box_at(self, x: float, y: float) -> Box:
        """Corners of a thing with its middle at a place."""
        (width, depth, height), z = self.thing, self.block[1][2]
        low = (x - width / 2, y - depth / 2, z)
        return low, (x + width / 2, y + depth / 2, z + height)


PLACES = {
    "block": Place(
        size=(5.0, 4.0, 2.6),
        block=((2.0, 1.5, 0.0), (3.2, 2.3, 0.75)),
        things=((2.2, 1.85), (3.0, 1.95)),
        free=((2.55, 1.66), (2.65, 2.1)),
        thing=(0.24, 0.24, 0.3),
    ),
    "sideboard": Place(  # It stands at a wall, so that things have no back that can be seen.
        size=(4.4, 4.8, 2.5),
        block=((3.8, 1.4, 0.0), (4.4, 3.2, 0.6)),
        things=((4.1, 1.65), (4.05, 2.95)),
        free=((4.0, 2.1), (4.2, 2.5)),
        thing=(0.3, 0.2, 0.22),
    ),
}
RED, BLUE, YELLOW = (200, 40, 30), (30, 60, 200), (230, 200, 30)


def box_object(name: str, box: Box, texture: np.ndarray, *, inward: bool = False) -> HomeObject:
    """A box, or the walls around it, in squares of the colours [H,W,3] of a texture."""
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
    """Squares of random colours, no two places of which look the same."""
    colors = np.random.default_rng(seed).integers(darkest, 220, (SQUARES, SQUARES, 3))
    return colors.astype(np.uint8).repeat(16, 0).repeat(16, 1)


def thing(place: Place, name: str, x: float, y: float, color: Sequence[int]) -> HomeObject:
    """A thing of one colour on the block."""
    plain = np.full((4, 4, 3), color, np.uint8)
    return replace(box_object(name, place.box_at(x, y), plain), movable=True, parent="Block|1")


def home_of(place: Place) -> Home:
    """The room as it is mapped."""
    (x, y, z), first = place.size, 100 * list(PLACES.values()).index(place)
    # The walls go on below the floor, or two surfaces would be in one place.
    walls = box_object("Wall|1", ((0, 0, -0.2), (x, y, z)), squares(first, 40), inward=True)
    floor = box_object("Floor|1", ((0, 0, -0.1), (x, y, 0)), squares(first + 1, 90))
    block = box_object("Block|1", place.block, squares(first + 2, 110))
    (red, blue) = place.things
    return Home(
        name="settled",
        rooms=(Room("kitchen", np.array([[0, 0, 0], [x, y, z]])),),
        objects=(
            walls,
            replace(floor, receptacle=True),
            replace(block, receptacle=True, parent="Floor|1"),
            thing(place, "Box|1", *red, RED),
            thing(place, "Box|2", *blue, BLUE),
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


def changed(place: Place, kind: str, seed: int) -> tuple[Home, list[Box]]:
    """The room after a change, and where something was or is now that was not."""
    home = home_of(place)
    to = np.random.default_rng(seed).uniform(*place.free).tolist()
    if kind == "removal":
        return home.without(["Box|1"]), [place.box_at(*place.things[0])]
    if kind == "addition":
        new = thing(place, "Box|3", *to, YELLOW)
        return replace(home, objects=(*home.objects, new)), [place.box_at(*to)]
    rest = home.without(["Box|2"])
    moved = replace(rest, objects=(*rest.objects, thing(place, "Box|2", *to, BLUE)))
    return moved, [place.box_at(*place.things[1]), place.box_at(*to)]


def robot_in(home: Home, seed: int) -> Controller:
    """A robot with a noisy camera."""
    return Controller(home, width=WIDTH, height=HEIGHT, noise="kinect", seed=seed)


def looks_at(box: Box, robot: Controller) -> list[Viewpoint]:
    """Looks at the middle of a box from all around, as far as the robot can stand there."""
    middle = np.mean(box, axis=0)
    eye_m = float(robot.observe().camera.world_from_camera[2, 3])
    places = robot.reachable_positions()
    chosen = set()
    for turn_rad in 2 * np.pi * np.arange(VIEWS) / VIEWS + 0.2:
        wanted = middle[:2] + AWAY_M * np.array([np.cos(turn_rad), np.sin(turn_rad)])
        metres = np.linalg.norm(places - wanted, axis=1)
        if metres.min() < AWAY_M / 2:
            chosen.add(int(np.argmin(metres)))
    looks = []
    for x, y in places[sorted(chosen)]:
        way = middle[:2] - (x, y)
        down_deg = np.degrees(np.arctan2(eye_m - middle[2], np.linalg.norm(way)))
        yaw_deg = np.degrees(np.arctan2(way[1], way[0]))
        looks.append(Viewpoint(x, y, float(yaw_deg), float(down_deg)))
    return looks


def write_map(home: Home, seed: int, folder: Path) -> None:
    """Maps a home with the noise of a seed, unless that was done before."""
    if folder.exists():
        return
    with TemporaryDirectory() as visit:
        capture(robot_in(home, seed), explore(home, FRAMES)[0], Path(visit) / "visit")
        result = make_map(open_dataset(Path(visit) / "visit"), MAPPING)
    cameras = {name: one.camera() for name, one in result.training.items()}
    write_map_folder(folder, result.gaussian_map, {"dataset": "visit"}, cameras)


def is_at(point: np.ndarray, boxes: Sequence[Any]) -> bool:
    """Whether a point (3,) is in a box, or near it."""
    corners = [np.array(box) for box in boxes]
    return any(((point >= low - NEAR_M) & (point <= high + NEAR_M)).all() for low, high in corners)


def run_case(place: Place, kind: str, seed: int, made: Path) -> dict[str, Any]:
    """What two rounds do after a change."""
    home, boxes = changed(place, kind, seed)
    config = LoopConfig(stops=STOPS, detection=DetectionConfig(halvings=0), update=UPDATE)
    said: list[str] = []
    start_s = time.process_time()
    with TemporaryDirectory() as name:
        folder = Path(name) / "map"
        shutil.copytree(made, folder)
        with MapKeeper(folder, config, say=said.append) as keeper:
            keeper.go_round(robot_in(home, 1_000_000 + seed))
            first, rest = keeper.version.number, len(said)
            cameras = cameras_of_map(folder).values()
            detector = ChangeDetector(keeper.gaussian_map, config.detection, cameras=cameras)
            robot = robot_in(home, 2_000_000 + seed)
            told: list[float | None] = []
            errors = []
            for look in [look for box in boxes for look in looks_at(box, robot)]:
                robot.go(look)
                frame = robot.observe()
                found = detector.detect(frame).changes
                own = [one.confidence for one in found if is_at(one.point, boxes)]
                told.append(max(own, default=None))
                rgb = render(keeper.gaussian_map, frame.camera).rgb.clip(0, 1)
                errors.append(float(np.mean((rgb - frame.rgb / 255) ** 2)))
            keeper.go_round(robot_in(home, 3_000_000 + seed))
            second = keeper.version.number
        with open_map(folder) as store:
            known, late = (
                [
                    box
                    for one in store.events()
                    if low < one.version <= high
                    for box in one.boxes
                    if box
                ]
                for low, high in ((1, first), (first, second))
            )
    return {
        "kind": kind,
        "seed": seed,
        "made": all(any(is_at(np.mean(one, axis=0), [box]) for one in known) for box in boxes),
        "versions": [first, second],
        "reports": told,
        "anew": [is_at(np.mean(box, axis=0), boxes) for box in late],
        "psnr_db": psnr_from_mse_db(float(np.mean(errors))),
        "said": [said[:rest], said[rest:]],
        "cpu_s": round(time.process_time() - start_s, 1),
    }


def summary(cases: Sequence[dict[str, Any]]) -> list[str]:
    """A markdown table with a row for each room and kind, and one for all."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for one in cases:
        groups.setdefault((one["room"], one["kind"]), []).append(one)
    lines = [
        "| room | change | updated | views without a report there | cases without one "
        "| second rounds without a version there | without any | PSNR |",
        "| --- | --- | --: | --: | --: | --: | --: | --: |",
    ]
    for (room, kind), own in [*groups.items(), (("all", ""), list(cases))]:
        # Where a change was not found in the first round, nothing can be settled.
        made = [one for one in own if one["made"]]
        views = [report is None for one in made for report in one["reports"]]
        silent = [all(report is None for report in one["reports"]) for one in made]
        still = [one["versions"][0] == one["versions"][1] for one in made]
        kept = [not any(one["anew"]) for one in made]
        shares = " | ".join(share(one) for one in (views, silent, kept, still))
        psnr_db = np.mean([one["psnr_db"] for one in own])
        lines.append(
            f"| {room} | {kind} | {len(made)} of {len(own)} | {shares} | {psnr_db:.2f} dB |"
        )
    return lines


def share(answers: Sequence[bool]) -> str:
    """How many of some answers are yes, and their share."""
    if not answers:
        return "-"
    return f"{sum(answers)} of {len(answers)} ({100 * np.mean(answers):.0f} %)"


def main() -> None:
    """Measures all cases and prints the shares."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rooms", nargs="+", default=list(PLACES), choices=PLACES)
    parser.add_argument("--kinds", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--seeds", default="0:20", help="first and last but one, of the noise")
    parser.add_argument("--maps", type=int, default=4, help="of a room, with other noise")
    parser.add_argument("--work", type=Path, default=Path("out/settled"), help="keeps the maps")
    parser.add_argument("--out", type=Path, default=Path("out/settled.json"))
    given = parser.parse_args()
    seeds = range(*map(int, given.seeds.split(":")))
    wanted = [(s, room, kind) for s in seeds for room in given.rooms for kind in given.kinds]
    cases: list[dict[str, Any]] = []
    for seed, room, kind in tqdm(wanted, desc="cases"):
        made = given.work / f"{room}_{seed % given.maps}"
        write_map(home_of(PLACES[room]), seed % given.maps, made)
        cases.append({"room": room, **run_case(PLACES[room], kind, seed, made)})
        given.out.parent.mkdir(parents=True, exist_ok=True)
        given.out.write_text(json.dumps(cases, indent=1) + "\n")
    print("\n".join(summary(cases)))


if __name__ == "__main__":
    main()
