"""Arguments that commands of the simulator share."""

from __future__ import annotations

from typing import Annotated

import typer

Source = Annotated[
    str,
    typer.Argument(help="kitchen, living_room, bedroom or flat, or a .glb or .gltf file."),
]
"""Argument of the commands that open a home."""
Seed = Annotated[int, typer.Argument(min=0, help="Same seed, same home.")]
"""Argument: seed of a generated home."""
Noise = Annotated[str, typer.Option(help="Noise of the camera: none or kinect.")]
"""Option: preset of the camera's noise."""
Width = Annotated[int, typer.Option(min=16, max=4096, help="px")]
"""Option: width of the images."""
Height = Annotated[int, typer.Option(min=16, max=4096, help="px")]
"""Option: height of the images."""
