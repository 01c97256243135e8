"""Clone of a shared map in a folder, which works on without the others."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from gslts.fleet.shared_version import FileName, SharedVersion, file_path
from gslts.localization.landmark_files import LANDMARK_FILES
from gslts.semantics.files import autoencoder_path
from gslts.store.causes import ExtensionCause, RejectedUpdateCause, SemanticsCause, UpdateCause
from gslts.store.delta import Delta, delta_from_arrays
from gslts.store.manifest import (
    CAMERAS,
    MANIFEST,
    require_map_folder,
    update_image_path,
)
from gslts.store.map_store import MapStore
from gslts.store.measurement_files import MEASUREMENT_FILES
from gslts.store.records import Blob, ObjectEvent, Rejection, Version
from gslts.store.trajectory_file import TRAJECTORY


@dataclass(frozen=True, eq=False)
class OwnVersion:
    """A version that only this clone has.

    Attributes:
        version: Its record.
        events: Object changes that it shows.
        earlier_rejections: Updates that its robot rejected since its previous version.
        later_rejections: Updates that were rejected while it was the newest version.
        image: Content of its image; None if it has none.
    """

    version: Version
    events: tuple[ObjectEvent, ...]
    earlier_rejections: tuple[Rejection, ...]
    later_rejections: tuple[Rejection, ...]
    image: bytes | None


class Replica(MapStore):
    """Store of a map that can exchange versions with the clones of other robots.

    Args:
        folder: Folder of the map. No other process may write it meanwhile.

    Raises:
        OSError: The folder cannot be read, or another process writes it.
        ValueError: The path is no folder of a map.
    """

    def __init__(self, folder: Path) -> None:
        require_map_folder(folder)
        super().__init__(folder, writable=True)

    def origin(self) -> str:
        """Return the identity of the map, which all of its clones share.

        Returns:
            SHA-256 of the manifest and of when the first version was made.

        Raises:
            OSError: The manifest cannot be read.
        """
        first = self.version(1)
        head = f"{first.time_s!r} {first.gaussians} {first.next_id} "
        return hashlib.sha256(head.encode() + (self.folder / MANIFEST).read_bytes()).hexdigest()

    def share(self, own: OwnVersion, previous: str | None) -> SharedVersion:
        """Return a version as it is shared.

        Args:
            own: The version.
            previous: SHA-256 of the version object before; None for the first one.

        Raises:
            OSError: A file cannot be read.
        """
        version = own.version
        return SharedVersion(
            origin=self.origin(),
            previous=previous,
            version=version,
            snapshot=self._index.snapshots().get(version.number),
            events=own.events,
            rejections=own.earlier_rejections,
            files={name: blob_of(path) for name, path in self._files(version)},
        )

    def paths(self, shared: SharedVersion) -> list[tuple[Blob, Path]]:
        """Return the blobs of a shared version, and their paths in this folder.

        Args:
            shared: The version.
        """
        number = shared.version.number
        gaussians = [blob for blob in (shared.version.delta, shared.snapshot) if blob is not None]
        return [
            *((blob, self._blobs.path(blob.key)) for blob in gaussians),
            *(
                (blob, file_path(self.folder, name, number, blob))
                for name, blob in shared.files.items()
            ),
        ]

    def own_versions(self, after: int) -> list[OwnVersion]:
        """Return the versions after those that others have.

        Args:
            after: Number of the last version that others have.

        Raises:
            OSError: An image cannot be read.
        """
        events: dict[int, list[ObjectEvent]] = {}
        for event in self.events():
            change = ObjectEvent(**event.model_dump(exclude={"version"}))
            events.setdefault(event.version, []).append(change)
        rejections = self.rejections()
        own: list[OwnVersion] = []
        last_of: dict[str | None, int] = {}
        for version in self.versions():
            number, since = version.number, last_of.get(version.robot, 1)
            last_of[version.robot] = number
            if number <= after:
                continue
            image = update_image_path(self.folder, number)
            own.append(
                OwnVersion(
                    version=version,
                    events=tuple(events.get(number, ())),
                    earlier_rejections=tuple(
                        rejection
                        for rejection in rejections
                        if rejection.robot == version.robot and since <= rejection.version < number
                    ),
                    later_rejections=tuple(r for r in rejections if r.version == number),
                    image=image.read_bytes() if image.exists() else None,
                )
            )
        return own

    @contextmanager
    def replacing(self, after: int, theirs: Sequence[SharedVersion]) -> Iterator[None]:
        """Replace own versions by those of others, in one transaction with what the caller adds.

        Args:
            after: Number of the last version that stays.
            theirs: Next versions; their files are there.

        Yields:
            None, when theirs are the newest versions.

        Raises:
            OSError: A file cannot be read or written; then no version is replaced.
            ValueError: The new versions cannot be read; then no version is replaced.
        """
        with self._index.transaction():
            self._index.remove_after(after)
            for shared in theirs:
                self._index.add(shared.version, shared.snapshot, shared.events)
                for rejection in shared.rejections:
                    self._index.add_rejection(rejection)
            newest = self.version()
            if self.read().size != newest.gaussians:
                raise ValueError(
                    f"{self._folder}: version {newest.number} has not the number of Gaussians that "
                    "it tells; nothing was pulled"
                )
            yield

    def read_delta(self, version: Version) -> Delta:
        """Read the changes of a version.

        Args:
            version: Update or extension.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is damaged, or was removed before the version was pushed.
        """
        if version.delta is None:
            raise ValueError(
                f"{self._folder}: version {version.number} was compacted before it was pushed, so "
                "that it cannot follow the versions of others; restore a backup, push, then compact"
            )
        return delta_from_arrays(self._blobs.read(version.delta))

    def commit_again(
        self,
        version: Version,
        delta: Delta,
        cause: UpdateCause | ExtensionCause,
        events: Sequence[ObjectEvent],
    ) -> Version:
        """Add a version that was made after an older version of the map.

        Args:
            version: As it was made.
            delta: From the newest version.
            cause: Of the new version.
            events: Object changes that it shows.

        Returns:
            The new version, with time, robot and program of the old one.

        Raises:
            OSError: A file cannot be written.
            ValueError: The delta does not apply to the newest version.
        """
        made = {"gslts": version.gslts, "time_s": version.time_s, "robot": version.robot}
        return self._commit(delta, cause, events, **made)

    def reject_again(self, record: Version | Rejection, cause: RejectedUpdateCause) -> None:
        """Record an update that was made earlier as rejected, with the newest version.

        Args:
            record: Made then; gives time, robot and program.
            cause: The attempt and the reason.

        Raises:
            OSError: The index cannot be written.
        """
        self._index.add_rejection(
            Rejection(
                version=self.version().number,
                gslts=record.gslts,
                time_s=record.time_s,
                cause=cause,
                robot=record.robot,
            )
        )

    def _files(self, version: Version) -> Iterator[tuple[FileName, Path]]:
        """Yield the files of a version besides its Gaussians."""
        folder, number, cause = self.folder, version.number, version.cause
        if number == 1:
            yield "manifest", folder / MANIFEST
            yield "cameras", folder / CAMERAS
            if (folder / TRAJECTORY).exists():
                yield "trajectory", folder / TRAJECTORY
        for files in (LANDMARK_FILES, MEASUREMENT_FILES):
            digest = files.digest_of_manifest(folder) if number == 1 else files.digest_of(version)
            if digest is not None:
                yield files.kind, files.find(folder, digest)
        if isinstance(cause, SemanticsCause) and cause.autoencoder is not None:
            yield "autoencoder", autoencoder_path(folder, cause.autoencoder)
        if (image := update_image_path(folder, number)).exists():
            yield "image", image


def blob_of(path: Path) -> Blob:
    """Return the blob of a file.

    Args:
        path: Of the file.

    Raises:
        OSError: The file cannot be read.
    """
    content = path.read_bytes()
    return Blob(key=hashlib.sha256(content).hexdigest(), size=len(content))
