import pytest

from tagmap.service.wildcards import covers, is_exact


@pytest.mark.parametrize(
    ("key_expr", "key", "expected"),
    [
        ("a/b", "a/b", True),
        ("a/b", "a/bc", False),
        ("a/*", "a/b", True),
        ("a/*", "a", False),
        ("a/*", "a/b/c", False),
        ("a/**", "a", True),
        ("a/**", "a/b/c", True),
        ("**", "a/b", True),
        ("a/**/c", "a/c", True),
        ("a/**/c", "a/b/b/c", True),
        ("a/**/c", "ac", False),
        ("a/r$*", "a/r12", True),
        ("a/$*1$*", "a/r12", True),
        ("a/r$*", "a/q", False),
        ("a.b", "aXb", False),
    ],
)
def test_covers(key_expr, key, expected):
    assert covers(key_expr, key) is expected


def test_is_exact():
    assert is_exact("a/b")
    assert not is_exact("a/$*")
