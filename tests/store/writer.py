"""A process that writes until it is killed; after each commit it says on stdout what is safe.

python -m tests.store.writer (site|outbox) PATH SESSION
"""

import sys
from itertools import count
from pathlib import Path

from tagmap.store import Batch, Outbox, SiteStore
from tests.store.records import SITE, hello, keyframe

BATCH = 50
SIGHTINGS = 3


def write_site(path: Path, session: str) -> None:
    with SiteStore.open(path, SITE) as store:
        for n in count():
            seqs = range(n * BATCH + 1, (n + 1) * BATCH + 1)
            keyframes = [keyframe(seq, session=session, sightings=SIGHTINGS) for seq in seqs]
            store.commit(Batch(hellos=[hello(session=session)], keyframes=keyframes))
            print(seqs[-1], flush=True)


def write_outbox(path: Path, session: str) -> None:
    """Item n of the source is the payload `n`; with every third batch the oldest are settled."""
    with Outbox.open(path) as outbox:
        outbox.start_session(session, b"hello")
        for n in count():
            cursor = outbox.cursor()
            items = [(n * BATCH + i, str(cursor + i).encode()) for i in range(1, BATCH + 1)]
            outbox.append(session, items, cursor + BATCH)
            print(cursor + BATCH, flush=True)
            if n % 3 == 2:
                oldest = outbox.pending_sessions()[0]
                seqs = [seq for name, seq, _ in outbox.unsettled(BATCH) if name == oldest]
                outbox.settle(oldest, seqs[-1])


if __name__ == "__main__":
    {"site": write_site, "outbox": write_outbox}[sys.argv[1]](Path(sys.argv[2]), sys.argv[3])
