"""The Gaussians of a page: what it has, and what it needs to show another version."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gslts.types import Bytes, Floats
from gslts.viewer.blocks import UNIT_M, Block, Cell

MIN_COLOR_CHANGE = 4
"""Colours of a block are sent again when their mean change is greater, in 1/255: below, another
direction of view makes no visible difference."""

_Change = tuple[Cell, Block, Bytes]


class Splats:
    """Blocks of Gaussians in the scene of a page.

    Args:
        scene: Of a page, or of a server of viser.
    """

    def __init__(self, scene: Any) -> None:
        self._scene = scene
        self._sent: dict[Cell, tuple[bytes, Bytes]] = {}
        self._handles: dict[Cell, Any] = {}
        self._is_hidden = False

    @property
    def is_empty(self) -> bool:
        """True before the first block is sent."""
        return not self._sent

    def changes(self, blocks: Mapping[Cell, Block], eye: Floats) -> list[_Change]:
        """List the blocks that differ from those of the page, with their new colours.

        Args:
            blocks: All blocks to be shown.
            eye: (3,) position of the viewer, relative to the origin of the map, m.

        Returns:
            Arguments of `send`.
        """
        result = []
        for cell, block in blocks.items():
            colors = block.colors(eye)
            digest, sent = self._sent.get(cell, (b"", colors))
            change = np.abs(colors.astype(np.int16) - sent) if digest == block.digest else None
            if change is None or change.mean() > MIN_COLOR_CHANGE:
                result.append((cell, block, colors))
        return result

    def send(self, changes: Sequence[_Change]) -> None:
        """Send blocks.

        Args:
            changes: From `changes`.
        """
        for cell, block, colors in changes:
            arrays = block.centers, block.covariances, colors, block.opacities
            if cell in self._handles:
                self._handles[cell].set_gaussians(*arrays)
            else:
                self._handles[cell] = self._scene.add_gaussian_splats(
                    f"/map/{cell}", *arrays, scale=UNIT_M, visible=not self._is_hidden
                )
            self._sent[cell] = block.digest, colors

    def hide(self, hidden: bool) -> None:
        """Hide or show all blocks, also those to come.

        Args:
            hidden: True hides them.
        """
        self._is_hidden = hidden
        for handle in self._handles.values():
            handle.visible = not hidden

    def remove_others(self, blocks: Mapping[Cell, Block]) -> None:
        """Remove all blocks but some.

        Args:
            blocks: Those that stay.
        """
        for cell in self._handles.keys() - blocks.keys():
            self._handles.pop(cell).remove()
            del self._sent[cell]
