"""glTF files of homes: with materials, and with buffers and images in files of their folder."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote

from gslts.io.gltf_file import BadFileError, GltfFile

MAX_FILE_BYTES = 1 << 30
"""Maximum size of a file and all that it refers to, bytes: it must fit into memory several
times."""
EXTENSIONS = (
    *("KHR_texture_transform", "KHR_mesh_quantization", "KHR_lights_punctual"),
    *("KHR_materials_unlit", "EXT_texture_webp"),
)
"""Extensions that a file may require: they are supported or, as lights, can be ignored."""


class HomeFile(GltfFile):
    """A glTF file of a home.

    Args:
        path: A .glb or .gltf file; what a .gltf refers to must lie in its folder or below.

    Raises:
        OSError: A file cannot be read.
        ValueError: It is not a glTF 2.0 file, damaged, too large, or needs an unknown extension.
    """

    max_bytes = MAX_FILE_BYTES

    def reject(self, problem: str) -> NoReturn:
        """Raise a BadFileError that names the file, in one line.

        Args:
            problem: What is wrong.
        """
        try:
            super().reject(problem)
        except BadFileError as error:
            raise BadFileError(f"load_home: {error}") from None

    def supports(self, extension: str) -> bool:
        """Return whether a file may require an extension.

        Args:
            extension: Its name.
        """
        return extension in EXTENSIONS or extension.startswith("KHR_materials_")

    def resource(self, uri: Any) -> memoryview:
        """Return the bytes of a URI.

        Args:
            uri: Base64 data, or a file in the folder of this one or below; unvalidated.

        Raises:
            OSError: The file cannot be read.
            BadFileError: The URI is invalid, or leads out of the folder.
        """
        if not isinstance(uri, str):
            self.reject(f"a buffer has the URI {uri!r}; a file or data is missing")
        if uri.startswith("data:"):
            header, _, text = uri.partition(",")
            if not header.endswith(";base64"):
                self.reject(f"URI {uri[:40]!r}: only base64 data is read")
            return memoryview(base64.b64decode(text))
        relative = Path(unquote(uri))
        inside = self.path.parent.resolve()
        target = (inside / relative).resolve()
        remote = ":" in uri or "\\" in uri or "\0" in unquote(uri)
        if remote or relative.is_absolute() or not target.is_relative_to(inside):
            self.reject(f"URI {uri[:80]!r} does not lead into the folder of the file")
        return memoryview(self._read(target))
