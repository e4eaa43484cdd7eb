"""How users of other libraries would find spots: what theirs recommend, at their best settings."""

from typing import Any

import numpy as np
import numpy.typing as npt

from tagmap.conventions import Array


def opencv(image: npt.NDArray[Any], threshold: int, ambient: int) -> Array:
    """Positions (N, 2): threshold, contours, moments of the light in each one's bounding box."""
    import cv2

    _, mask = cv2.threshold(image, threshold, 255, cv2.THRESH_BINARY)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    found = []
    for contour in contours:
        x, y, width, height = cv2.boundingRect(contour)
        part = cv2.subtract(image[y : y + height, x : x + width], np.array([float(ambient)]))
        moments = cv2.moments(part)
        if moments["m00"] > 0.0:
            found.append((x + moments["m10"] / moments["m00"], y + moments["m01"] / moments["m00"]))
    return np.array(found).reshape(-1, 2)


def sep_available() -> bool:
    try:
        import sep  # noqa: F401
    except ImportError:
        return False
    return True


def sep_windowed(image: npt.NDArray[Any], ambient: float, noise: float, sigma_px: float) -> Array:
    """Positions (N, 2): SExtractor's extraction and windowed centroids, told about the background.

    Its own estimate of the background would take several times as long as the rest.
    """
    import sep

    light = image.astype(np.float32)
    light -= ambient
    found = sep.extract(light, 5.0, err=noise)
    u, v, _ = sep.winpos(light, found["x"], found["y"], sigma_px)
    return np.stack([u, v], axis=-1)
