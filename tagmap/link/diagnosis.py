"""Why there is no connection, in words: Zenoh itself only says "Timeout!"."""

import re
import socket
import ssl
from pathlib import Path

from tagmap.link.settings import Settings

PATIENCE_S = 1.0
_ENDPOINT = re.compile(
    r"^(?P<protocol>[a-z0-9-]+)/\[?(?P<host>[^/\]]+?)\]?:(?P<port>\d{1,5})([?#].*)?$"
)


def why_unreachable(endpoint: str, tls: Settings) -> str:
    """Try `endpoint` as a plain program would and tell what is in the way."""
    parts = _ENDPOINT.match(endpoint)
    if parts is None or int(parts["port"]) > 65535:
        return "not an endpoint, expected one like tcp/127.0.0.1:7447"
    address = (parts["host"], int(parts["port"]))
    try:
        with socket.create_connection(address, timeout=PATIENCE_S) as connection:
            if parts["protocol"] == "tls":
                return _why_not_secure(connection, address[0], tls)
    except TimeoutError:
        return f"no answer within {PATIENCE_S:g} s"
    except (OSError, UnicodeError) as error:
        return str(getattr(error, "strerror", None) or error)
    return "something answers there, but no router: does it expect tls/, or no tls/?"


def why_not_listening(message: str) -> str:
    """The operating system's words inside Zenoh's message, or all of it where there are none."""
    found = re.search(r"([A-Z][\w ]+) \(os error \d+\)", message)
    return found[1] if found else message


def _why_not_secure(connection: socket.socket, host: str, tls: Settings) -> str:
    names = ("root_ca_certificate", "connect_certificate", "connect_private_key")
    files = [tls.get(name) for name in names]
    if None in files:
        return "it wants certificates; give a configuration that names them"
    for file in files:
        if not Path(str(file)).is_file():
            return f"{file}: no such file"
    try:
        context = ssl.create_default_context(cafile=files[0])
        context.load_cert_chain(str(files[1]), str(files[2]))
    except OSError as error:
        return f"{files[1]} with its key is not usable: {error}"
    context.check_hostname = tls.get("verify_name_on_connect") is not False
    return _shake_hands(context, connection, host)


def _shake_hands(context: ssl.SSLContext, connection: socket.socket, host: str) -> str:
    """A router that refuses our certificate says so only when we read from it."""
    try:
        with context.wrap_socket(connection, server_hostname=host) as secured:
            secured.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"its certificate is not accepted: {error.verify_message}"
    except ssl.SSLError as error:
        return f"it refuses our certificate: {(error.reason or str(error)).lower()}"
    except TimeoutError:
        return "it accepts our certificate, but no session"
    return "it accepts our certificate, but closes the connection"
