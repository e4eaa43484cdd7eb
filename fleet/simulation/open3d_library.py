"""Open3D where it is needed, and only there: it takes a second to import, half of it for drawing
in web pages, which nobody here does.

Its wheels link to libusb, for cameras that nobody here has, and do not bring it. Where the system
has none, the one of the package libusb-package is loaded first.
"""

import contextlib
import ctypes
import sys
from types import ModuleType

from tagmap.errors import TagmapError

WEB = "open3d.visualization.draw_plotly"
OF_WEB = ("get_plotly_fig", "draw_plotly", "draw_plotly_server")


def open3d() -> ModuleType:
    """Raises TagmapError, which says what to install."""
    with contextlib.suppress(ImportError, OSError):
        import libusb_package

        ctypes.CDLL(str(libusb_package.get_library_path()), mode=ctypes.RTLD_GLOBAL)
    if WEB not in sys.modules:
        sys.modules[WEB] = ModuleType(WEB)
        sys.modules[WEB].__dict__.update(dict.fromkeys(OF_WEB))
    try:
        import open3d as library
    except (ImportError, OSError) as error:
        raise TagmapError(f"Open3D cannot be used ({error}): install tagmap[sim]") from None
    module: ModuleType = library
    return module
