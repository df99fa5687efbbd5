"""The middlewares that a context opens by URL, put here by those who make them: ``register("local", make)``."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.rclc._types import Middleware

_engines: "dict[str, Callable[[str, int], Middleware]]" = {}


def register(scheme: str, make: "Callable[[str, int], Middleware]") -> None:
    """Has URLs that begin with ``scheme`` and a colon opened by ``make(url, domain_id)``."""
    _engines[scheme] = make


def open_url(url: str, domain_id: int) -> "Middleware":
    """The middleware of a URL; ValueError when nobody has registered its scheme."""
    scheme = url.split(":")[0]
    make = _engines.get(scheme)
    if make is None:
        raise ValueError(
            "%r: no middleware for %s: is registered. Go through an agent: Context(Udp('127.0.0.1', 8888))"
            % (url, scheme)
        )
    return make(url, domain_id)
