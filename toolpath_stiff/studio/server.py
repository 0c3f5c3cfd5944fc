"""The studio's server: 127.0.0.1 alone, a token in the address that it opens, no foreign Host or Origin, small bodies.

Only the standard library. A page is one document, as the static reports are; it asks for the state, is told of every
change by an event stream, and posts what is to be done.
"""

import hmac
import json
import secrets
import threading
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote, urlsplit

from toolpath_stiff.api.inputs import finite
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.files import is_file
from toolpath_stiff.studio.actions import do, take_file
from toolpath_stiff.studio.page import exported, page
from toolpath_stiff.studio.picture import document
from toolpath_stiff.studio.session import Session

LARGEST_FILE = 64 * 1024 * 1024  # bytes of a dropped file
LARGEST_QUESTION = 1024 * 1024
BEAT = 15.0  # s between two signs of life of an event stream
PLAIN = {
    **dict.fromkeys((".toml", ".py", ".nc", ".ngc", ".txt"), "text/plain"),
    ".json": "application/json",
    ".csv": "text/csv",
    ".png": "image/png",
    ".html": "text/html",
    ".pdf": "application/pdf",
    ".svg": "image/svg+xml",
}
SANDBOX = "sandbox allow-scripts"  # a page among the results has an origin of its own and cannot ask the studio
REFUSED = "This is a studio of toolpath_stiff. Open the address that `tps studio` has printed, with its token."


class Studio(ThreadingHTTPServer):
    """The server of one session.

    Attributes
    ----------
    session
        What is served.
    token
        What the address must hold.
    """

    daemon_threads = True
    allow_reuse_address = False

    def __init__(self, session: Session, port: int = 0) -> None:
        super().__init__(("127.0.0.1", port), Handler)
        self.session, self.token = session, secrets.token_urlsafe(24)
        self.closing = threading.Event()

    @property
    def address(self) -> str:
        """Address that the browser opens."""
        return f"http://127.0.0.1:{self.server_port}/?token={self.token}"

    def close(self) -> None:
        """Stop serving and end the work under way."""
        self.closing.set()
        self.session.close()
        self.shutdown()
        self.server_close()


class Handler(BaseHTTPRequestHandler):
    """One HTTP connection."""

    server: Studio
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "tps-studio", ""
    timeout = 120
    disable_nagle_algorithm = True  # head and body go out at once: a hand at a slider would wait 40 ms for each answer

    def log_message(self, format: str, *args: Any) -> None:
        """Log nothing on the terminal: the page reports errors."""

    def do_GET(self) -> None:
        """Serve the page, the state, the events and results; POST carries actions and files."""
        try:
            if self._refused():
                self.close_connection = True
                self._send(HTTPStatus.FORBIDDEN, REFUSED, "text/plain")
            elif self.command == "GET":
                self._get()
            else:
                self._post()
        except TpsError as error:
            self._json({"error": str(error)})
        except (ConnectionError, TimeoutError):  # the tab was closed
            self.close_connection = True
        except OSError as error:
            self._json({"error": error.strerror or str(error)})

    do_POST = do_GET  # noqa: N815  (a name of the standard library)

    @property
    def _cookie_name(self) -> str:
        return f"tps_studio_{self.server.server_port}"

    def _refused(self) -> bool:
        port = self.server.server_port
        hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        if host not in hosts or (origin is not None and origin not in {f"http://{host}"}):
            return True
        foreign = self.headers.get("Sec-Fetch-Site", "same-origin") not in ("same-origin", "none")
        if foreign or (self.command == "POST" and origin is None):
            return True
        given = parse_qs(urlsplit(self.path).query).get("token", [""])[0] if self.command == "GET" else ""
        try:
            cookie = SimpleCookie(self.headers.get("Cookie", "")).get(self._cookie_name)
        except CookieError:
            cookie = None
        known = self.server.token.encode()
        return not (
            hmac.compare_digest(given.encode(), known)
            or (cookie is not None and hmac.compare_digest(cookie.value.encode(), known))
        )

    def _get(self) -> None:
        parts, session = urlsplit(self.path), self.server.session
        if "token" in parse_qs(parts.query):  # from now on in a cookie: it stays out of histories and referrers
            cookie = f"{self._cookie_name}={self.server.token}; HttpOnly; SameSite=Strict; Path=/"
            return self._send(HTTPStatus.SEE_OTHER, "", "text/plain", more={"Location": "/", "Set-Cookie": cookie})
        if parts.path == "/":
            return self._send(HTTPStatus.OK, page(), "text/html")
        if parts.path == "/state":
            return self._json(document(session))
        if parts.path == "/events":
            return self._events()
        if parts.path == "/export":
            return self._send(HTTPStatus.OK, exported(session), "text/html", f"{session.name}.html")
        if parts.path.startswith("/case/"):
            return self._file(unquote(parts.path.removeprefix("/case/")))
        return self._send(HTTPStatus.NOT_FOUND, "there is no such page", "text/plain")

    def _post(self) -> None:
        parts, session = urlsplit(self.path), self.server.session
        largest = LARGEST_FILE if parts.path == "/file" else LARGEST_QUESTION
        try:
            length = int(self.headers.get("Content-Length", ""))
        except ValueError:
            length = -1
        if not 0 <= length <= largest:
            self.close_connection = True
            return self._json({"error": f"more than {largest // 2**20} MB"}, HTTPStatus.REQUEST_ENTITY_TOO_LARGE)
        body = self.rfile.read(length)
        if parts.path == "/file":
            query = {name: values[0] for name, values in parse_qs(parts.query).items()}
            return self._json(take_file(session, query.get("name", "file"), body, query.get("run") == "yes"))
        try:
            question = json.loads(body, parse_float=_number, parse_constant=_number)
        except (ValueError, RecursionError):
            raise InputError("the question is no JSON") from None
        if parts.path == "/do" and isinstance(question, dict):
            return self._json(do(session, question))
        return self._send(HTTPStatus.NOT_FOUND, "there is no such page", "text/plain")

    def _events(self) -> None:
        """Send the session's version after every change, until the tab is closed."""
        self.send_response(HTTPStatus.OK)
        self.send_header("Content-Type", "text/event-stream")
        self.send_header("Cache-Control", "no-store")
        self.send_header("Connection", "close")
        self.end_headers()
        self.close_connection = True
        seen: tuple[int, int] = (-1, -1)
        while not self.server.closing.is_set():
            now = self.server.session.wait(seen, BEAT)
            sign = f"data: {json.dumps(self.server.session.news())}" if now != seen else ": here"
            self.wfile.write(f"{sign}\n\n".encode())
            self.wfile.flush()
            seen = now

    def _file(self, name: str) -> None:
        folder = self.server.session.case.folder.resolve()
        file = (folder / name.replace("\0", "")).resolve()
        room = file.relative_to(folder).parts[0] if file.is_relative_to(folder) and file != folder else "exercise"
        # Programs may have any suffix; everything among the results was written by the tool.
        known = PLAIN.get(file.suffix, "text/plain" if room == "results" else "")
        if not known or "exercise" in room or not is_file(file):
            return self._send(HTTPStatus.NOT_FOUND, "the case has no such file", "text/plain")
        saved = "" if file.suffix in (".html", ".png", ".svg") else file.name
        return self._send(HTTPStatus.OK, file.read_bytes(), known, saved, {"Content-Security-Policy": SANDBOX})

    def _json(self, document: Any, status: HTTPStatus = HTTPStatus.OK) -> None:
        self._send(status, json.dumps(document, ensure_ascii=False, allow_nan=False), "application/json")

    def _send(
        self, status: HTTPStatus, content: str | bytes, kind: str, saved: str = "", more: dict[str, str] | None = None
    ) -> None:
        body = content.encode() if isinstance(content, str) else content
        self.send_response(status)
        headers = {
            "Content-Type": kind if kind in ("image/png", "application/pdf") else f"{kind}; charset=utf-8",
            "Content-Length": str(len(body)),
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Resource-Policy": "same-origin",
            **(more or {}),
        }
        if saved:
            safe = "".join(c if c.isalnum() or c in "._-" else "_" for c in Path(saved).name)
            headers["Content-Disposition"] = f'attachment; filename="{safe}"'
        for header, value in headers.items():
            self.send_header(header, value)
        self.end_headers()
        self.wfile.write(body)


def _number(text: str) -> float:
    return finite("the question holds", text)
