import pytest

from tagmap.errors import RecordRefused
from tagmap.mapping.surveying import SurveyedPosition, surveyed


def test_whole_numbers_are_numbers() -> None:
    assert surveyed("6", (1, -2, 3.5), 1) == SurveyedPosition("6", (1.0, -2.0, 3.5), 1.0)


@pytest.mark.parametrize(
    ("tag", "p_m", "sigma_m", "said"),
    [
        ("No Tag", (0, 0, 0), 0.1, "tag is 'No Tag'"),
        (None, (0, 0, 0), 0.1, "tag is 'None'"),
        ("6", (0, 0), 0.1, "2 numbers"),
        ("6", (0, None, 0), 0.1, "y is 'None'"),
        ("6", (0, 0, float("nan")), 0.1, "z is 'nan'"),
        ("6", (float("-inf"), 0, 0), 0.1, "x is '-inf'"),
        ("6", (-1e300, 0, 0), 0.1, "x is '-1e+300'"),
        ("6", (0, 0, 0), 0.0, "sigma is 0 m"),
        ("6", (0, 0, 0), -0.1, "sigma is -0.1 m"),
        ("6", (0, 0, 0), 1e-200, "sigma is 1e-200 m"),
        ("6", (0, 0, 0), float("inf"), "sigma is 'inf'"),
    ],
)
def test_what_no_solver_could_digest_is_refused(
    tag: object, p_m: tuple[object, ...], sigma_m: object, said: str
) -> None:
    with pytest.raises(RecordRefused, match="expected") as refused:
        surveyed(tag, p_m, sigma_m)
    assert said in str(refused.value)
