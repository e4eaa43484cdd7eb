import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from robot_agent.calibration.images import find_pairs, read_grey
from tagmap.errors import DataError


def touch(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).touch()
    return folder


def test_pairs_go_by_what_follows_the_side(tmp_path: Path):
    touch(tmp_path, "left-1.png", "Right_1.TIF", "left02.jpg", "right02.jpeg")
    touch(tmp_path, "left_intrinsics.yml", "notes.txt", "lefty.txt", "centre01.png")
    pairs = find_pairs(tmp_path)
    assert [(p.name, p.left.name, p.right.name) for p in pairs] == [
        ("02", "left02.jpg", "right02.jpeg"),
        ("1", "left-1.png", "Right_1.TIF"),
    ]


def test_files_without_partner_are_named(tmp_path: Path):
    touch(tmp_path, "left01.png", "right01.png", "left02.png", "right03.png")
    with pytest.raises(DataError, match=r"no partner for left02\.png, right03\.png"):
        find_pairs(tmp_path)


def test_two_files_for_one_place_are_named(tmp_path: Path):
    touch(tmp_path, "left01.png", "left-01.jpg", "right01.png")
    with pytest.raises(DataError, match=r"left-01\.jpg and left01\.png are both left"):
        find_pairs(tmp_path)


def test_a_folder_without_images(tmp_path: Path):
    with pytest.raises(DataError, match=r"no images left\* and right\*"):
        find_pairs(tmp_path)
    with pytest.raises(DataError, match="No such file"):
        find_pairs(tmp_path / "nowhere")


def write(path: Path, image: np.ndarray) -> Path:
    assert cv2.imwrite(str(path), image)
    return path


def test_colour_becomes_grey(tmp_path: Path):
    colour = np.zeros((64, 65, 3), np.uint8)
    colour[1, 2] = 200
    grey = read_grey(write(tmp_path / "a.png", colour))
    assert grey.dtype == np.uint8
    assert grey.shape == (64, 65)
    assert grey[1, 2] == 200


def test_twelve_bits_in_sixteen_are_stretched(tmp_path: Path):
    black = np.zeros((64, 64), np.uint16)
    image = black.copy()
    image[0, :3] = 0, 2048, 4095
    assert read_grey(write(tmp_path / "a.tiff", image))[0, :3].tolist() == [0, 128, 255]
    assert not read_grey(write(tmp_path / "b.png", black)).any()


@pytest.mark.parametrize("content", [b"", b"not an image", b"\x89PNG\r\n\x1a\n"])
def test_what_is_no_image_is_named(tmp_path: Path, content: bytes):
    path = tmp_path / "left01.png"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"left01\.png: not an image.* JPEG"):
        read_grey(path)


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.full((64, 64), np.nan, np.float32), r"holds float32, expected 8 or 16 bits"),
        (np.zeros((3, 4), np.uint8), r"4 x 3 px, expected at least 64 px"),
    ],
)
def test_images_of_another_kind(tmp_path: Path, image: np.ndarray, reason: str):
    with pytest.raises(DataError, match=reason):
        read_grey(write(tmp_path / "left01.tiff", image))


def test_a_cut_image_is_named_and_decoders_are_silent(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    noise = np.random.default_rng(1).integers(0, 255, (80, 90), np.uint8)
    path = write(tmp_path / "left01.png", noise)
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(DataError, match=r"left01\.png: not an image"):
        read_grey(path)
    assert capfd.readouterr().err == ""


def test_an_orientation_in_a_jpeg_is_ignored(tmp_path: Path):
    path = write(tmp_path / "left01.jpg", np.zeros((64, 80), np.uint8))
    turned = struct.pack("<2sHIHHHIHHI", b"II", 42, 8, 1, 0x0112, 3, 1, 6, 0, 0)
    exif = b"Exif\0\0" + turned
    plain = path.read_bytes()
    path.write_bytes(plain[:2] + struct.pack(">HH", 0xFFE1, len(exif) + 2) + exif + plain[2:])
    assert cv2.imread(str(path), cv2.IMREAD_GRAYSCALE).shape == (80, 64)
    assert read_grey(path).shape == (64, 80)
