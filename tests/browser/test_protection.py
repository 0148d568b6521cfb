"""What others can do to a dashboard, one that was started in a folder whose configuration takes all protection away."""

import contextlib
import http.client
import socket
from pathlib import Path
from urllib.parse import urlsplit

import pytest

pytestmark = pytest.mark.browser
EVIL = "http://evil.example"


def _ask(address, method, path, host="", **headers):
    parts = urlsplit(address)
    connection = http.client.HTTPConnection("127.0.0.1", parts.port, timeout=20)
    connection.request(
        method, path, body=b"x" if method == "PUT" else None, headers={"Host": host or parts.netloc, **headers}
    )
    with contextlib.closing(connection):
        answer = connection.getresponse()
        if answer.status != http.HTTPStatus.SWITCHING_PROTOCOLS:  # what follows then never ends
            answer.read()
        return answer


def _websocket(address, **headers):
    return _ask(
        address, "GET", "/_stcore/stream", **headers, Connection="Upgrade", Upgrade="websocket",
        **{"Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version": "13"},
    )  # fmt: skip


def test_pages_of_others_may_read_nothing(address):
    for path in ("/_stcore/health", "/_stcore/host-config", "/_stcore/upload_file/session/file", "/media/x"):
        allowed = _ask(address, "GET", path, Origin=EVIL).headers.get("Access-Control-Allow-Origin")
        assert allowed not in ("*", EVIL), path


def test_pages_of_others_may_send_nothing(address):
    for method in ("PUT", "DELETE"):
        for headers in ({}, {"Origin": EVIL}, {"X-Xsrftoken": "2|0|0|0", "Cookie": "_streamlit_xsrf=2|0|0|0"}):
            assert _ask(address, method, "/_stcore/upload_file/session/file", **headers).status == 403


def test_pages_of_others_open_no_session(address):
    assert _websocket(address, Origin=EVIL).status == 403
    assert _websocket(address, Origin=address.rstrip("/")).status == 101


def test_other_names_of_this_machine_open_no_session(address):
    assert _websocket(address, host="evil.example").status == 403


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="what listens is looked for in Linux' /proc")
def test_other_machines_do_not_reach_it(address):
    port = urlsplit(address).port
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port]
    assert listening == [f"{int.from_bytes(socket.inet_aton('127.0.0.1'), 'little'):08X}:{port:04X}"]
