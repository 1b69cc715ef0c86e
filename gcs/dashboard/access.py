"""Who may see and use a dashboard that other machines reach: whoever knows its token.

The address that is printed carries the token. The first visit puts it into a cookie that scripts cannot read and other
sites cannot use, and goes on to the address without it; the page's WebSocket is let in by the same cookie.
"""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from bokeh.server.auth_provider import AuthProvider

if TYPE_CHECKING:
    from tornado.web import RequestHandler

__all__ = ["TokenAccess"]

_OPERATOR = "operator"
_REFUSAL = """<!doctype html>
<title>403: the dashboard's token is missing</title>
<h1>This dashboard asks for its token</h1>
<p>Open the address that <code>arvi</code> printed when it started, with <code>?token=&hellip;</code> at its end.
A dashboard that is started again has a new one.</p>
"""


class TokenAccess(AuthProvider):  # type: ignore[misc]  # bokeh's types are skipped
    """Asked by bokeh about every request, a WebSocket's too, before anything is done for it.

    Args:
        token: The secret.
        port: Of the dashboard; cookies are a machine's, not a port's.

    Attributes:
        cookie: Name of the cookie.
    """

    def __init__(self, token: str, port: int) -> None:
        self.cookie = f"arvi-dashboard-{port}"
        self._token = token.encode()
        super().__init__()

    @property
    def get_user_async(self) -> Callable[[RequestHandler], Awaitable[str | None]]:
        """Lets a request pass, or answers it."""
        return self._admit

    @property
    def login_url(self) -> str:
        """Bokeh wants one; who is refused is answered before it is used."""
        return "/"

    async def _admit(self, handler: RequestHandler) -> str | None:
        request = handler.request
        asked = request.arguments.get("token", [])
        if asked and self._is_token(asked[0]):
            if request.method == "GET" and request.path == "/":
                rest = {name: values for name, values in request.arguments.items() if name != "token"}
                handler.set_cookie(self.cookie, self._token.decode(), httponly=True, samesite="Strict")
                handler.redirect("/" + ("?" + urlencode(rest, doseq=True) if rest else ""))
            return _OPERATOR
        kept = request.cookies.get(self.cookie)
        if kept is not None and self._is_token(kept.value.encode()):
            return _OPERATOR
        handler.set_status(403)
        handler.set_header("Content-Type", "text/html; charset=utf-8")
        await handler.finish(_REFUSAL)
        return None

    def _is_token(self, given: bytes) -> bool:
        return hmac.compare_digest(given, self._token)
