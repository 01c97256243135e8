"""Real object stores on this machine, of S3 and of Azure, which tests and benchmarks start.

    npm install azurite
    pip install 'moto[s3,server]'

installs both: Azurite, Microsoft's emulator of Azure Blob Storage, and the S3 server of moto. They
are found on the path, or by the environment variables AZURITE and MOTO_SERVER; Azurite also where
`scripts/setup test` installs it.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import http.client
import json
import os
import re
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from email.utils import formatdate
from pathlib import Path
from urllib.parse import urlencode

ACCOUNT = "devstoreaccount1"
KEY = "Eby8vdM02xNOcqFlqUwJPLlmEtlCDXJ1OUzFT50uSRZ6IFsuFq2UVErCz4I6tq/K1SZFPTOtr/KBHBeksoGMGw=="
"""Account and key of the emulator, which are public:
https://learn.microsoft.com/azure/storage/common/storage-connect-azurite."""
CONTAINER = "maps"
"""Bucket that is made in the new store."""
START_S = 30.0
"""Maximum time of a start, s."""
JUDGES = Path(__file__).resolve().parents[2] / "build" / "judges" / "node_modules" / ".bin"
"""Programs of npm that `scripts/setup test` installs."""


@dataclass(frozen=True)
class StoreProgram:
    """A program that serves an object store.

    Attributes:
        scheme: Of the URLs of its buckets.
        executable: File name of the program.
        variable: Environment variable with its path.
        package: Command that installs it.
    """

    scheme: str
    executable: str
    variable: str
    package: str

    @property
    def bucket(self) -> str:
        """URL of the bucket that is made in a new store."""
        return f"{self.scheme}://{CONTAINER}"

    def find(self) -> str | None:
        """Return the path of the program; None if it is not installed."""
        path = f"{os.environ.get('PATH', '')}{os.pathsep}{JUDGES}"
        return os.environ.get(self.variable) or shutil.which(self.executable, path=path)

    def arguments(self, port: int, folder: str) -> list[str]:
        """Return the arguments of the program.

        Args:
            port: That it serves.
            folder: Empty folder for its data.
        """
        if self is S3:
            return ["--port", str(port)]
        options = ["--silent", "--disableTelemetry", "--skipApiVersionCheck"]
        return ["--blobPort", str(port), "--location", folder, *options]

    def environment(self, port: int | str, *, read_only: bool = False) -> dict[str, str]:
        """Return the environment variables with which obstore finds the store.

        Args:
            port: Of the store, or of a proxy in front of it.
            read_only: Give credentials that only allow to read. The S3 server checks credentials
                from then on, and knows no others.
        """
        if self is S3:
            name, secret = _reading_user(int(port)) if read_only else (ACCOUNT, KEY)
            return {
                "AWS_ACCESS_KEY_ID": name,
                "AWS_SECRET_ACCESS_KEY": secret,
                "AWS_ENDPOINT": f"http://127.0.0.1:{port}",
                "AWS_ALLOW_HTTP": "true",
                "AWS_REGION": "us-east-1",
            }
        settings = {
            "AZURE_STORAGE_ACCOUNT_NAME": ACCOUNT,
            "AZURE_STORAGE_ENDPOINT": f"http://127.0.0.1:{port}/{ACCOUNT}",
            "AZURE_ALLOW_HTTP": "true",
        }
        if read_only:
            return {**settings, "AZURE_STORAGE_SAS_KEY": _reading_token()}
        return {**settings, "AZURE_STORAGE_ACCOUNT_KEY": KEY}


AZURITE = StoreProgram("az", "azurite-blob", "AZURITE", "npm install azurite")
S3 = StoreProgram("s3", "moto_server", "MOTO_SERVER", "pip install 'moto[s3,server]'")
PROGRAMS = {"azurite": AZURITE, "moto": S3}
"""All stores by name."""


@contextmanager
def object_store(program: StoreProgram = AZURITE) -> Iterator[int]:
    """Start an empty store with one bucket.

    Args:
        program: Of the store.

    Yields:
        Its port on this machine.

    Raises:
        OSError: It is not installed or does not start.
    """
    path = program.find()
    if path is None:
        raise FileNotFoundError(
            f"{program.executable} is missing: {program.package}, and set {program.variable}"
        )
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        process = subprocess.Popen(
            [path, *program.arguments(port, folder)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            _wait_for(process, port)
            _create_bucket(program, port)
            yield port
        finally:
            process.terminate()
            process.wait()


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
    raise OSError(f"{process.args}: the store does not start")


def _create_bucket(program: StoreProgram, port: int) -> None:
    """Create the bucket; obstore makes none. Azurite checks the signature, moto does not."""
    path, headers = f"/{CONTAINER}", {"Content-Length": "0"}
    if program is AZURITE:
        path = f"/{ACCOUNT}/{CONTAINER}?restype=container"
        headers |= _shared_key_headers()
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=START_S)
    connection.request("PUT", path, headers=headers)
    status = connection.getresponse().status
    connection.close()
    if status not in (http.client.OK, http.client.CREATED):
        raise OSError(f"{program.executable}: the bucket cannot be made: status {status}")


def _shared_key_headers() -> dict[str, str]:
    """Return the headers of a request for a container, signed as Azure's Shared Key asks for."""
    date, version = formatdate(usegmt=True), "2021-12-02"
    text = (
        f"PUT{12 * chr(10)}x-ms-date:{date}\nx-ms-version:{version}\n"
        f"/{ACCOUNT}/{ACCOUNT}/{CONTAINER}\nrestype:container"
    )
    signature = f"SharedKey {ACCOUNT}:{_sign(text)}"
    return {"x-ms-date": date, "x-ms-version": version, "Authorization": signature}


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


def _reading_user(port: int) -> tuple[str, str]:
    """Make a user of moto that may read the bucket, and return the name and secret of its key."""
    allowed = {"Effect": "Allow", "Action": ["s3:GetObject", "s3:ListBucket"], "Resource": "*"}
    policy = json.dumps({"Version": "2012-10-17", "Statement": [allowed]})
    user = {"UserName": "reader"}
    _post_iam(port, {"Action": "CreateUser", **user})
    _post_iam(
        port,
        {"Action": "PutUserPolicy", **user, "PolicyName": "read", "PolicyDocument": policy},
    )
    answer = _post_iam(port, {"Action": "CreateAccessKey", **user})
    _post(port, "/moto-api/reset-auth", "0", {"Content-Type": "text/plain"})
    name, secret = (
        re.findall(f"<{field}>(.*)</{field}>", answer)[0]
        for field in ("AccessKeyId", "SecretAccessKey")
    )
    return name, secret


def _post_iam(port: int, fields: dict[str, str]) -> str:
    """Ask moto's IAM, which is chosen by the scope of the signature."""
    scope = "Credential=any/20260101/us-east-1/iam/aws4_request"
    headers = {
        "Authorization": f"AWS4-HMAC-SHA256 {scope}, SignedHeaders=host, Signature=none",
        "Content-Type": "application/x-www-form-urlencoded",
    }
    return _post(port, "/", urlencode({**fields, "Version": "2010-05-08"}), headers)


def _post(port: int, path: str, body: str, headers: dict[str, str]) -> str:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=START_S)
    connection.request("POST", path, body, headers)
    response = connection.getresponse()
    answer = response.read().decode()
    connection.close()
    if response.status != http.client.OK:
        raise OSError(f"moto: {path}: status {response.status}")
    return answer


def _sign(text: str) -> str:
    digest = hmac.new(base64.b64decode(KEY), text.encode(), hashlib.sha256).digest()
    return base64.b64encode(digest).decode()
