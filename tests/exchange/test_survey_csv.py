import pytest

from tagmap.errors import DataError
from tagmap.exchange.survey_csv import read_surveys

HEADER = "tag,x_m,y_m,z_m,sigma_m\n"


def written(tmp_path, text):
    path = tmp_path / "survey.csv"
    path.write_text(text)
    return path


def test_reads_rows_and_skips_empty_lines(tmp_path):
    path = written(tmp_path, HEADER + "6,1,2,3,0.01\n\n 7 , -1.5,0,0, 1e-3\n")
    assert [(p.tag, p.p_m, p.sigma_m) for p in read_surveys(path)] == [
        ("6", (1.0, 2.0, 3.0), 0.01),
        ("7", (-1.5, 0.0, 0.0), 0.001),
    ]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: header"),
        ("tag,x,y,z,s\n", "line 1: header"),
        (HEADER + "6,1,2,3\n", "line 2: 4 columns, expected 5"),
        (HEADER + "6,1,two,3,0.1\n", "line 2: y_m is 'two'"),
        (HEADER + "6,1,nan,3,0.1\n", "line 2: y is 'nan'"),
        (HEADER + "6,1,2,3,0\n", "line 2: sigma is 0 m"),
        (HEADER + "No Tag,1,2,3,1\n", "line 2: tag is 'No Tag'"),
        (HEADER + "6,1,2,3,1\n7,1,2,3,1\n6,1,2,3,1\n", "line 4: tag 6 is already in line 2"),
    ],
)
def test_names_file_and_line_of_what_is_wrong(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(DataError) as caught:
        read_surveys(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_binary_one(tmp_path):
    with pytest.raises(DataError, match="No such file"):
        read_surveys(tmp_path / "none.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="not UTF-8"):
        read_surveys(tmp_path / "binary.csv")
