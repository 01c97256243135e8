"""A real object store on this machine: Azurite, Microsoft's emulator of Azure Blob Storage.

    npm install azurite

installs it; it is found on the path, or by the environment variable AZURITE.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import http.client
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from email.utils import formatdate
from urllib.parse import urlencode

ACCOUNT = "devstoreaccount1"
KEY = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw=="
"""Account and key of the emulator, which are public:
https://learn.microsoft.com/azure/storage/common/storage-connect-azurite."""
CONTAINER = "maps"
"""Bucket that is made in the new store."""
START_S = 30.0
"""Maximum time of a start, s."""


def find_azurite() -> str | None:
    """Return the path of the program; None if it is not installed."""
    return os.environ.get("AZURITE") or shutil.which("azurite-blob")


@contextmanager
def object_store() -> Iterator[int]:
    """Start an empty store with one bucket.

    Yields:
        Its port on this machine.

    Raises:
        OSError: It is not installed or does not start.
    """
    program = find_azurite()
    if program is None:
        raise FileNotFoundError("azurite-blob is missing: npm install azurite, and set AZURITE")
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        options = ["--silent", "--disableTelemetry", "--skipApiVersionCheck"]
        process = subprocess.Popen(
            [program, "--blobPort", str(port), "--location", folder, *options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait_for(process, port)
            _create_container(port)
            yield port
        finally:
            process.terminate()
            process.wait()


def store_environment(port: int | str, *, read_only: bool = False) -> dict[str, str]:
    """Return the environment variables with which obstore finds a store.

    Args:
        port: Of the store, or of a proxy in front of it.
        read_only: Give credentials that only allow to read.
    """
    settings = {
        "AZURE_STORAGE_ACCOUNT_NAME": ACCOUNT,
        "AZURE_STORAGE_ENDPOINT": f"http://127.0.0.1:{port}/{ACCOUNT}",
        "AZURE_ALLOW_HTTP": "true",
    }
    if read_only:
        return {**settings, "AZURE_STORAGE_SAS_KEY": _reading_token()}
    return {**settings, "AZURE_STORAGE_ACCOUNT_KEY": KEY}


def free_port() -> int:
    """Return a port that nothing uses now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait_for(process: subprocess.Popen[bytes], port: int) -> None:
    give_up_s = time.monotonic() + START_S
    while time.monotonic() < give_up_s and process.poll() is None:
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise OSError("azurite-blob does not start")


def _create_container(port: int) -> None:
    """Create the bucket, signed as Azure's Shared Key asks for; obstore makes no buckets."""
    date, version = formatdate(usegmt=True), "2021-12-02"
    text = (
        f"PUT{12 * chr(10)}x-ms-date:{date}\nx-ms-version:{version}\n"
        f"/{ACCOUNT}/{ACCOUNT}/{CONTAINER}\nrestype:container"
    )
    headers = {
        "x-ms-date": date,
        "x-ms-version": version,
        "Authorization": f"SharedKey {ACCOUNT}:{_sign(text)}",
        "Content-Length": "0",
    }
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=START_S)
    connection.request("PUT", f"/{ACCOUNT}/{CONTAINER}?restype=container", headers=headers)
    status = connection.getresponse().status
    connection.close()
    if status != http.client.CREATED:
        raise OSError(f"azurite-blob: the bucket cannot be made: status {status}")


def _reading_token() -> str:
    """Return a shared access signature of the bucket that allows to read for a day."""
    start, end = (
        time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(time.time() + shift_s))
        for shift_s in (-3600, 86400)
    )
    version = "2018-11-09"
    text = "\n".join(
        ["r", start, end, f"/blob/{ACCOUNT}/{CONTAINER}", *["", "", "", version, "c"], *[""] * 6]
    )
    fields = {"sv": version, "sr": "c", "sp": "r", "st": start, "se": end, "sig": _sign(text)}
    return urlencode(fields)


def _sign(text: str) -> str:
    digest = hmac.new(base64.b64decode(KEY), text.encode(), hashlib.sha256).digest()
    return base64.b64encode(digest).decode()
