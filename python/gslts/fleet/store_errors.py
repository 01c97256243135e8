"""Errors of obstore as errors of Python in one line, with the next step."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from urllib.parse import urlsplit


@dataclass(frozen=True)
class _Variables:
    """Environment variables of a store.

    Attributes:
        credentials: Those with the credentials.
        endpoint: The one with the URL of a store of one's own, or how such ones begin.
        allow_http: The one that allows such a URL without TLS.
    """

    credentials: str
    endpoint: str
    allow_http: str


VARIABLES = {
    "s3": _Variables(
        "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY", "AWS_ENDPOINT", "AWS_ALLOW_HTTP"
    ),
    "gs": _Variables("GOOGLE_APPLICATION_CREDENTIALS", "GOOGLE_BASE_URL", "GOOGLE_ALLOW_HTTP"),
    "az": _Variables(
        "AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY",
        "AZURE_STORAGE_ENDPOINT",
        "AZURE_ALLOW_HTTP",
    ),
}
"""Environment variables by scheme."""
PROBLEMS = (
    (
        # Without credentials, obstore asks the host of a virtual machine for some.
        "169\\.254\\.169\\.254|Account must be specified|MissingAccount",
        "there are no credentials: set {credentials}",
    ),
    (
        "(open|read|decode) service account|Invalid Access Key",
        "the credentials cannot be read; check {credentials}",
    ),
    (
        "RequestTimeTooSkewed|Request date header|reasonable timeframe",
        "the clock of this machine differs from that of the store; set it and try again",
    ),
    (
        "InvalidAccessKeyId|SignatureDoesNotMatch|ExpiredToken|InvalidToken|invalid_grant"
        "|Server failed to authenticate",
        "the store does not accept the credentials; check {credentials}",
    ),
    (
        "incorrectly configured region|AuthorizationHeaderMalformed",
        "the bucket is in another region; set AWS_REGION",
    ),
    (
        "HTTP error: builder error",
        "{endpoint} has no TLS; give an https:// URL, or set {allow_http}=true",
    ),
)
"""Errors that no repetition mends: texts of obstore, of S3, Azure and Google, and the next step."""
FORBIDDEN, NOT_FOUND = "403 Forbidden", "404 Not Found"
"""Texts of errors of listings; those of other requests have types of their own in obstore."""
MAX_MESSAGE = 200
"""Maximum length of a reason of a store in an error, characters."""


def require_endpoint(url: str) -> None:
    """Check the environment variable with the endpoint of a store; obstore crashes at some texts.

    Args:
        url: Of a shared map.

    Raises:
        ValueError: It is no URL.
    """
    variables = VARIABLES.get(urlsplit(url).scheme)
    if variables is None:
        return
    for name, value in os.environ.items():  # AWS_ENDPOINT_URL serves as AWS_ENDPOINT does.
        is_endpoint = name.startswith(variables.endpoint) and bool(value)
        if is_endpoint and not re.fullmatch("https?://[^\\s/].*", value):
            raise ValueError(
                f"{name}: {value!r} is no endpoint; expected https:// or http://, and the host"
            )


@contextmanager
def named_errors(url: str, action: str) -> Iterator[None]:
    """Raise errors of obstore as OSError in one line with the URL.

    Args:
        url: Of the shared map.
        action: Such as "reading".

    Yields:
        None.

    Raises:
        PermissionError: A repetition would fail again.
        FileExistsError: The object is there already.
        FileNotFoundError: There is no such object or bucket.
        OSError: Any other error.
    """
    from obstore.exceptions import (  # Optional; `remote_store` says so if it is missing.
        AlreadyExistsError,
        BaseError,
        PermissionDeniedError,
        UnauthenticatedError,
    )

    try:
        yield
    except AlreadyExistsError as error:
        raise FileExistsError(f"{url}: {_reason(error)}") from error
    except BaseError as error:
        text, variables = str(error), VARIABLES.get(urlsplit(url).scheme)
        for pattern, problem in PROBLEMS:
            if variables is not None and re.search(pattern, text):
                raise PermissionError(f"{url}: {problem.format(**asdict(variables))}") from error
        if isinstance(error, PermissionDeniedError | UnauthenticatedError) or FORBIDDEN in text:
            raise PermissionError(
                f"{url}: the credentials do not permit {action}; check the URL, or ask the owner "
                "of the bucket"
            ) from error
        if NOT_FOUND in text:
            raise FileNotFoundError(f"{url}: there is no such bucket") from error
        raise OSError(f"{url}: {_reason(error)}") from error


def _reason(error: BaseException) -> str:
    """Return the reason of an error of obstore: its first line without times and XML."""
    text = re.sub(r" in [\d.]+.?s\b.*? - ", ": ", str(error).split("\n", 1)[0]).split("<?xml")[0]
    if "error sending request" in text:
        return "the store cannot be reached; check the network, the endpoint and the URL"
    status = re.search(r"status code: (5\d\d[\w ]*)", text)
    if status:
        return f"the store fails ({status[1].strip()}); try again later"
    return re.sub(r"^Generic \w+ error: ", "", text).strip(" :")[:MAX_MESSAGE]
