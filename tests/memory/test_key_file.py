import pytest

from tagmap.errors import ConfigError
from tagmap.memory.key_file import read_key


def test_the_key_is_the_whole_file(tmp_path):
    path = tmp_path / "key"
    path.write_bytes(bytes(range(32)))
    assert read_key(path) == bytes(range(32))


@pytest.mark.parametrize("content", [None, b"", b"too short"])
def test_unusable_keys(tmp_path, content):
    path = tmp_path / "key"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match=str(path)):
        read_key(path)
