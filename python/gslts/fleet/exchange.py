"""Exchange of versions between a clone and the shared map: clone, pull, push."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from gslts.fleet.constants import MAX_RACES
from gslts.fleet.rebase import Rebased, rebase
from gslts.fleet.remote_store import RemoteStore, version_name
from gslts.fleet.replica import Replica
from gslts.fleet.shared_version import SharedVersion, file_path, parse_shared_version
from gslts.fleet.state import (
    RemoteState,
    read_remote_state,
    require_remote_state,
    write_remote_state,
)
from gslts.io.atomic_files import (
    name_in_errors,
    remove_tree,
    sync_folder,
    temporary_path,
    write_atomic,
)
from gslts.store.history import INDEX
from gslts.store.index import Index
from gslts.store.manifest import update_image_path
from gslts.store.records import Version


@dataclass(frozen=True)
class Exchange:
    """Outcome of an exchange.

    Attributes:
        version: Newest version of the clone.
        pulled: Versions of others that came.
        pushed: Own versions that the others have now.
        replayed: Own versions that follow versions of others now, under new numbers.
        given_up: Own changes that are not shown any more, one reason each; `gslts log` lists them.
    """

    version: Version
    pulled: int = 0
    pushed: int = 0
    replayed: int = 0
    given_up: tuple[str, ...] = ()


@dataclass(frozen=True)
class _Fetched:
    """A version object.

    Attributes:
        shared: Its content.
        state: State of a clone that has the version.
    """

    shared: SharedVersion
    state: RemoteState


def clone_map(url: str, folder: Path) -> Version:
    """Copy a shared map into a new folder. It appears complete or not at all.

    Args:
        url: Of the shared map.
        folder: Must not exist.

    Returns:
        The newest version.

    Raises:
        OSError: The folder exists or cannot be written, or the map cannot be read.
        ValueError: The map is damaged or of a newer format.
    """
    if folder.exists():
        raise FileExistsError(f"{folder} exists already")
    remote = RemoteStore(url)
    fetched = list(_fetch(remote, RemoteState(url=remote.url)))
    if not fetched:
        raise _no_map(remote)
    first = fetched[0].shared
    folder.parent.mkdir(parents=True, exist_ok=True)
    temporary = temporary_path(folder)
    with name_in_errors(folder, temporary):
        temporary.mkdir()
    try:
        Index(temporary / INDEX, new=True).close()
        files = first.files.items()
        remote.download([(blob, file_path(temporary, name, 1, blob)) for name, blob in files])
        with Replica(temporary) as replica:
            _add(replica, remote, 0, fetched)
            if replica.origin() != first.origin:
                raise ValueError(f"{url}: version 1 was exchanged: it is of another map")
        write_remote_state(fetched[-1].state, temporary)
        sync_folder(temporary)
        temporary.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        remove_tree(temporary)
        raise
    return fetched[-1].shared.version


def pull_map(folder: Path, url: str | None = None) -> Exchange:
    """Bring the versions of others into a clone; own versions follow them.

    Args:
        folder: Folder of the map.
        url: Of the shared map; None means that of the last exchange.

    Returns:
        The outcome.

    Raises:
        OSError: The map cannot be read or written; then the clone is as before.
        ValueError: The URL holds another map, a newer format, or damaged files.
    """
    with Replica(folder) as replica:
        remote, state = _connect(replica, url)
        state, outcome = _pull(replica, remote, state)
        if state.number == 0:
            raise _no_map(remote)
        return outcome


def push_map(folder: Path, url: str | None = None) -> Exchange:
    """Give the versions of a clone to the others, after those that came before.

    A version counts as pushed when its object was created: of two robots that create the same
    number, the second one pulls what the first one made, and tries the next number.

    Args:
        folder: Folder of the map.
        url: Of the shared map; None means that of the last exchange. A new URL gets the whole map.

    Returns:
        The outcome.

    Raises:
        OSError: The map cannot be read or written. What was pushed before is there.
        ValueError: The URL holds another map, a newer format, or damaged files.
    """
    with Replica(folder) as replica:
        remote, state = _connect(replica, url, create=True)
        pulled, replayed, pushed = 0, 0, 0
        given_up: tuple[str, ...] = ()
        for _ in range(MAX_RACES):
            state, outcome = _pull(replica, remote, state)
            pulled, replayed = pulled + outcome.pulled, outcome.replayed
            given_up += outcome.given_up
            before = state.number
            state = _push(replica, remote, state)
            pushed += state.number - before
            if state.number == replica.version().number:
                return Exchange(replica.version(), pulled, pushed, replayed, given_up)
    raise OSError(f"{remote.url}: other robots were faster {MAX_RACES} times; push again later")


def _connect(
    replica: Replica, url: str | None, *, create: bool = False
) -> tuple[RemoteStore, RemoteState]:
    """Return the shared map of a clone, and what is known of it."""
    if url is None:
        state = require_remote_state(replica.folder)
        return RemoteStore(state.url), state
    remote, known = RemoteStore(url, create=create), read_remote_state(replica.folder)
    if known is not None and known.url == remote.url:
        return remote, known
    return remote, RemoteState(url=remote.url)


def _fetch(
    remote: RemoteStore, state: RemoteState, replica: Replica | None = None
) -> Iterator[_Fetched]:
    """Yield the versions that others have made since a state, checked."""
    first = max(1, state.number)
    origin = None if replica is None else replica.origin()
    number, digest = first - 1, None
    contents = remote.read_versions(first, is_known=state.number > 0)
    for number, content in enumerate(contents, start=first):
        shared = parse_shared_version(content, f"{remote.url}/{version_name(number)}", number)
        if origin is not None and shared.origin != origin:
            raise ValueError(
                f"{remote.url}: it holds another map; choose another URL, or clone that map"
            )
        previous, digest = digest, hashlib.sha256(content).hexdigest()
        if digest != state.digest if number == state.number else shared.previous != previous:
            raise ValueError(
                f"{remote.url}: the history was exchanged: version {number} is not the one that "
                "came before; clone it anew, or restore the bucket"
            )
        origin = shared.origin
        if number > state.number:
            yield _Fetched(shared, RemoteState(url=remote.url, number=number, digest=digest))
    if state.number == 0:  # Later pulls do without this request.
        remote.check_end(number)
    if number < state.number:
        raise FileNotFoundError(
            f"{remote.url}: version {state.number} is missing, which it had before; check the URL "
            "and the bucket"
        )


def _pull(
    replica: Replica, remote: RemoteStore, state: RemoteState
) -> tuple[RemoteState, Exchange]:
    """Add the versions of others, and move own ones behind them."""
    fetched = list(_fetch(remote, state, replica))
    # Parsing a year of versions takes tenths of a second, and most pulls bring nothing.
    own = {version.number: version for version in replica.versions()} if fetched else {}
    while fetched and _is_same(own.get(state.number + 1), fetched[0].shared.version):
        state = fetched.pop(0).state
    outcome = Rebased()
    if fetched:
        outcome = _add(replica, remote, state.number, fetched)
        state = fetched[-1].state
    if state.number:
        write_remote_state(state, replica.folder)
    newest = replica.version()
    return state, Exchange(newest, len(fetched), 0, outcome.replayed, tuple(outcome.given_up))


def _add(replica: Replica, remote: RemoteStore, after: int, fetched: list[_Fetched]) -> Rebased:
    """Add versions of others after a version, and own versions anew after them."""
    own = replica.own_versions(after)
    theirs = [version.shared for version in fetched]
    images = {item.version.number: item.image for item in own}
    try:
        remote.download([file for shared in theirs for file in replica.paths(shared)])
        with replica.replacing(after, theirs):
            rebased = rebase(replica, after, theirs, own)
        theirs_have = {shared.version.number for shared in theirs if "image" in shared.files}
        numbers = {*images, *rebased.images} - theirs_have
        images = {number: rebased.images.get(number) for number in numbers}
    finally:  # Theirs may have the numbers of own ones, which are own again after an error.
        _write_images(replica.folder, images)
    return rebased


def _write_images(folder: Path, images: Mapping[int, bytes | None]) -> None:
    """Write the images of updates by number, and remove those that are None."""
    for number, image in images.items():
        path = update_image_path(folder, number)
        if image is None:
            path.unlink(missing_ok=True)
        else:
            write_atomic(path, image)


def _push(replica: Replica, remote: RemoteStore, state: RemoteState) -> RemoteState:
    """Create own versions until another robot is faster, and return the state after the last."""
    if state.number == replica.version().number:
        return state
    for own in replica.own_versions(state.number):
        shared = replica.share(own, state.digest)
        content, number = shared.to_bytes(), own.version.number
        parse_shared_version(content, f"{replica.folder}: version {number}", number)
        remote.upload(replica.paths(shared))
        if not remote.create_version(number, content):
            break
        digest = hashlib.sha256(content).hexdigest()
        state = RemoteState(url=remote.url, number=number, digest=digest)
        write_remote_state(state, replica.folder)
    return state


def _is_same(own: Version | None, other: Version) -> bool:
    """Return whether two records are of one version; either may be compacted."""
    without = {"delta": None}
    return own is not None and own.model_copy(update=without) == other.model_copy(update=without)


def _no_map(remote: RemoteStore) -> FileNotFoundError:
    return FileNotFoundError(
        f"{remote.url}: there is no shared map; check the URL and the bucket, or push one"
    )
