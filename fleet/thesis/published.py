"""What the tables of the thesis report: (mean, STD) by (distance m, baseline mm), N/A left out."""

from typing import TypeAlias

Cells: TypeAlias = dict[tuple[float, float], tuple[float, float]]

TABLE_4_1: Cells = {
    (1.2, 150.0): (0.0048, 0.013),
    (2.4, 150.0): (0.0033, 0.029),
    (2.4, 300.0): (0.0041, 0.0088),
}
"""Relative error of the length of a translation."""

TABLE_4_2: dict[str, Cells] = {
    "X": {
        (1.2, 150.0): (0.044, 0.543),
        (2.4, 150.0): (-0.267, 0.607),
        (2.4, 300.0): (0.165, 0.749),
    },
    "Y": {
        (1.2, 150.0): (-0.228, 0.336),
        (2.4, 150.0): (0.164, 0.292),
        (2.4, 300.0): (0.030, 0.664),
    },
    "Z": {
        (1.2, 150.0): (-0.242, 4.252),
        (2.4, 150.0): (-1.981, 6.576),
        (2.4, 300.0): (-0.871, 5.930),
    },
}
"""Relative positions, single image less stereo, mm."""

TABLE_4_3: dict[str, Cells] = {
    "X": {(1.2, 150.0): (21.02, 18.49), (2.4, 150.0): (22.99, 33.54), (2.4, 300.0): (2.34, 50.24)},
    "Y": {(1.2, 150.0): (9.07, 8.71), (2.4, 150.0): (13.79, 23.85), (2.4, 300.0): (-14.40, 26.71)},
    "Z": {(1.2, 150.0): (2.42, 10.66), (2.4, 150.0): (-30.30, 23.84), (2.4, 300.0): (24.95, 15.93)},
}
"""Absolute positions, single image less stereo, mm."""

TABLE_4_4: Cells = {
    (1.2, 120.0): (0.0045, 0.0035),
    (2.4, 120.0): (0.0022, 0.0032),
    (2.4, 240.0): (6.7860e-4, 7.6674e-4),
}
"""Angle between the axes from a single image and from stereo, degrees."""

TABLE_4_5: Cells = {
    (1.2, 120.0): (0.0496, 0.0068),
    (2.4, 120.0): (0.0252, 0.0055),
    (2.4, 240.0): (0.0432, 0.0079),
}
"""Angle between the axes before and after a translation, degrees."""
