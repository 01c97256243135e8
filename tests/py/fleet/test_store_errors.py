"""Errors of a store, which a server on loopback answers as S3, Azure and Google do."""

from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest

from gslts.fleet.constants import RETRIES
from gslts.fleet.remote_store import RemoteStore

Answer = Callable[[int, str], None]
URLS = {"s3": "s3://maps/flat", "az": "az://maps/flat"}


@pytest.fixture
def answer(monkeypatch: pytest.MonkeyPatch) -> Iterator[Answer]:
    """Return a function that sets status and body of all answers of the stores of these URLs."""
    answers = [(200, b"")]

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.rfile.read(int(self.headers.get("Content-Length", 0)))
            status, body = answers[-1]
            self.send_response(status)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def do_PUT(self) -> None:
            self.do_GET()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
    endpoint = f"http://127.0.0.1:{server.server_port}"
    for name, value in (
        ("AWS_ENDPOINT", endpoint),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_ACCESS_KEY_ID", "robot"),
        ("AWS_SECRET_ACCESS_KEY", "secret"),
        ("AZURE_STORAGE_ENDPOINT", endpoint),
        ("AZURE_ALLOW_HTTP", "true"),
        ("AZURE_STORAGE_ACCOUNT_NAME", "robot"),
        ("AZURE_STORAGE_ACCOUNT_KEY", "c2VjcmV0"),
    ):
        monkeypatch.setenv(name, value)
    monkeypatch.setitem(RETRIES, "max_retries", 0)
    yield lambda status, body: answers.append((status, body.encode()))
    server.shutdown()
    server.server_close()


def error_body(code: str, detail: str = "") -> str:
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<Error><Code>{code}</Code>{detail}</Error>'


TOO_OLD = (
    "<AuthenticationErrorDetail>Request date header too old: 'Fri, 27 Nov 2026 02:00:00 GMT'"
    "</AuthenticationErrorDetail>"
)
CLOCK = "the clock of this machine differs from that of the store; set it and try again"
UNKNOWN = "the store does not accept the credentials; check AWS_ACCESS_KEY_ID and AWS_SECRET"
REGION = "the bucket is in another region; set AWS_REGION"
DENIED = "the credentials do not permit reading; check the URL, or ask the owner of the bucket"


@pytest.mark.parametrize(
    ("scheme", "status", "body", "message"),
    [
        ("s3", 403, error_body("RequestTimeTooSkewed"), CLOCK),
        ("az", 403, error_body("AuthenticationFailed", TOO_OLD), CLOCK),
        ("s3", 403, error_body("SignatureDoesNotMatch"), UNKNOWN),
        ("s3", 403, error_body("InvalidAccessKeyId"), UNKNOWN),
        ("s3", 400, error_body("ExpiredToken"), UNKNOWN),
        ("s3", 301, error_body("PermanentRedirect"), REGION),
        ("s3", 400, error_body("AuthorizationHeaderMalformed"), REGION),
        ("s3", 403, error_body("AccessDenied"), DENIED),
        ("az", 403, error_body("AuthorizationPermissionMismatch"), DENIED),
    ],
)
def test_what_no_repetition_mends_names_the_next_step(
    answer: Answer, scheme: str, status: int, body: str, message: str
) -> None:
    answer(status, body)
    with pytest.raises(PermissionError, match=f"^{URLS[scheme]}: {message}"):
        RemoteStore(URLS[scheme]).read_version(1)


def test_what_must_not_be_written_is_not_tried_again(answer: Answer) -> None:
    answer(403, error_body("AccessDenied"))
    with pytest.raises(PermissionError, match="the credentials do not permit writing"):
        RemoteStore(URLS["s3"]).create_version(1, b"version")


@pytest.mark.parametrize(("status", "code"), [(403, "AccessDenied"), (404, "NoSuchBucket")])
@pytest.mark.parametrize("scheme", URLS)
def test_a_listing_that_is_not_permitted_finds_nothing(
    answer: Answer, scheme: str, status: int, code: str
) -> None:
    answer(status, error_body(code))
    RemoteStore(URLS[scheme]).check_end(1)


def test_a_store_that_fails_is_named(answer: Answer) -> None:
    answer(503, error_body("SlowDown"))
    message = r"the store fails \(503 Service Unavailable\); try again later"
    with pytest.raises(OSError, match=message):
        RemoteStore(URLS["s3"]).read_version(1)


@pytest.mark.usefixtures("answer")
def test_a_wrong_endpoint_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("AWS_ALLOW_HTTP")
    with pytest.raises(PermissionError, match="AWS_ENDPOINT has no TLS; give an https:// URL, or"):
        RemoteStore(URLS["s3"]).read_version(1)
    for name, scheme in (
        ("AWS_ENDPOINT", "s3"),
        ("AWS_ENDPOINT_URL", "s3"),
        ("AZURE_STORAGE_ENDPOINT", "az"),
    ):
        monkeypatch.delenv("AWS_ENDPOINT", raising=False)
        for wrong in ("minio:9000", "http://", "ftp://host"):
            monkeypatch.setenv(name, wrong)
            with pytest.raises(ValueError, match=f"{name}: '{wrong}' is no endpoint"):
                RemoteStore(URLS[scheme])
