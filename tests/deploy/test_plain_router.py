"""The plain router file says what `tagmap serve` starts by itself, and works."""

import json
from pathlib import Path

import zenoh

from tagmap.link.config import router_config
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link

PLAIN = Path(__file__).parents[2] / "deploy" / "router.plain.json5"


def test_the_file_says_what_the_code_says() -> None:
    built_in = router_config(["tcp/127.0.0.1:7447"], None)
    for section in ("mode", "listen", "connect", "scouting", "transport", "low_pass_filter"):
        assert json.loads(router_config([], PLAIN).get_json(section)) == json.loads(
            built_in.get_json(section)
        ), section
    assert zenoh.Config.from_file(PLAIN).get_json("mode") == '"router"'


def test_a_router_runs_on_it(tmp_path: Path, endpoint: str) -> None:
    config = tmp_path / "router.json5"
    config.write_text(PLAIN.read_text().replace("tcp/127.0.0.1:7447", endpoint))
    with (
        RouterProcess(config=config),
        Link.open([endpoint], wait_s=10.0) as service,
        Link.open([endpoint], wait_s=10.0) as agent,
    ):
        service.serve("tagmap/site/localize", lambda query: query.reply(query.key, b"pose"))
        assert agent.ask("tagmap/site/localize")[0].payload == b"pose"
        too_large = agent.get("tagmap/site/localize", bytes(70_000), timeout_s=1.0)
        assert not any(reply.payload for reply in too_large)
