"""Links to a plain router, closed when the test ends."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from tagmap.link.router import RouterProcess
from tagmap.link.session import Link


@pytest.fixture
def connect(router: RouterProcess, endpoint: str) -> Iterator[Callable[[], Link]]:
    """`connect()`: one more link to the test's router."""
    assert router.poll() is None
    with ExitStack() as stack:
        yield lambda: stack.enter_context(Link.open([endpoint], wait_s=10.0))
