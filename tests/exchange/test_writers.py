import io
import math

from tagmap.exchange.tags_csv import sigmas, write_tags_csv
from tagmap.exchange.tum import write_tum


def test_tum_keeps_nanoseconds_and_puts_the_scalar_last():
    file = io.StringIO()
    pose = {
        "t_ns": 1_700_000_000_000_000_001,
        "T_map_base": {"p_m": (1.0, 2.0, 3.0), "q_wxyz": (0.5, 0.1, 0.2, 0.3)},
    }
    assert write_tum(file, [pose]) == 1
    assert file.getvalue() == "1700000000.000000001 1 2 3 0.1 0.2 0.3 0.5\n"


def test_tum_of_a_planar_pose():
    file = io.StringIO()
    write_tum(file, [{"t_ns": 5, "T_map_base": {"p_m": (1.0, 2.0), "theta_rad": math.pi / 2}}])
    t, *numbers = map(float, file.getvalue().split())
    assert t == 5e-9
    half = math.sqrt(0.5)
    assert all(
        math.isclose(a, b, abs_tol=1e-8)
        for a, b in zip(numbers, [1, 2, 0, 0, 0, half, half], strict=True)
    )


def test_csv_leaves_unknown_cells_empty():
    tag = {"n": 3, "version": 2, "gauge": "floating"}
    file = io.StringIO()
    write_tags_csv(
        file,
        [
            {"tag": "a", "p_m": (1.0, 2.0), "cov": (4.0, 0.0, 9.0), "state": "mapped", **tag},
            {"tag": "b", "p_m": None, "cov": None, "state": "withheld", **tag},
        ],
    )
    assert file.getvalue().splitlines()[1:] == [
        "a,1.000000,2.000000,,2.000000,3.000000,,mapped,3,2,floating",
        "b,,,,,,,withheld,3,2,floating",
    ]


def test_sigmas_of_a_spatial_covariance():
    assert sigmas((1.0, 0.5, 0.5, 4.0, 0.5, 9.0)) == [1.0, 2.0, 3.0]
