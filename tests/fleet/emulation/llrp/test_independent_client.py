"""The emulated reader as a client with a codec of its own sees it: llrpjs, where Node has it.

`NODE_PATH` names the folder with `llrpjs` in it, as after `npm install llrpjs@1.0.1`.
"""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fleet.emulation.llrp.conftest import Stand, epc, lit

CLIENT = Path(__file__).with_name("client.cjs")
WORDS = ("e510", "0001", "ffff")


@pytest.fixture
def node() -> str:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no Node here, which the independent client needs")
    if subprocess.run([node, "-e", "require('llrpjs')"], capture_output=True).returncode:
        pytest.skip("Node has no llrpjs; NODE_PATH may name the folder with it")
    return node


def test_an_independent_client_agrees(node: str, stand: Callable[..., Stand]):
    s = stand(lit(1), lit(2))
    command = [node, str(CLIENT), str(s.server.address[1]), epc(1), *WORDS]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["greeting"] == "Success"
    assert found["firmware"] == "emulated"
    assert set(found["status"]) == {"M_Success"}
    assert found["refused"] == "A_Invalid"
    assert {heard.lower() for heard in found["heard"]} == {epc(1), epc(2)}
    assert found["written"] == ["Success", len(WORDS)]
    assert found["read"] == ["Success", "".join(WORDS).upper()]
    assert s.scene.tag(epc(1)).memory.words[:4] == (0xE510, 1, 0xFFFF, 0)
    assert not any(s.scene.tag(epc(2)).memory.words)
