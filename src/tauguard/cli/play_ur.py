"""``tauguard play-ur LOG``: send a log as a UR controller would, to test `listen`."""

from pathlib import Path
from typing import Annotated

import tyro


def command(
    log: Annotated[Path, tyro.conf.Positional],
    /,
    columns: str | None = None,
    port: int = 30004,
    fault: tuple[str, ...] = (),
) -> None:
    """Send a log as a Universal Robots controller would: by RTDE on 127.0.0.1, in real time.

    The log starts when the first client connects, and the command ends with the log. RTDE inputs
    are refused.

    Args:
        log: CSV or MCAP of an arm with six joints.
        columns: columns of CSV files, see `tauguard detect`.
        port: port of the server; 0 chooses a free one and prints it.
        fault: one or more faults to inject, NAME@SECONDS (lasts 1 s) or NAME@SECONDS+DURATION.
            Names: frozen, stale, encoder, missing, late, repeated, rate, jump, bias, saturated,
            swapped, sign, nan.
    """
    import tauguard as tg
    from tauguard.cli import expect
    from tauguard.live import Fault, Packets, UrServer

    expect("--port", port, 0, 65535)
    faults = [Fault.parse(text) for text in fault]
    trace = tg.read_log(log, columns).trace
    packets = Packets.of(trace)
    for one in faults:
        expect(f"--fault {one.name}@", one.start, 0, packets.t[-1] - packets.t[0])
        packets = one.apply(packets)
    with UrServer(packets, port) as server:
        print(
            f"{log}: {trace.t[-1] - trace.t[0]:.1f} s at {1 / trace.dt:.0f} Hz on "
            f"{server.host}:{server.port}, from the first client on (Ctrl-C ends)",
            flush=True,
        )
        while not server.wait(0.2):
            pass
        print(f"the log is over: {server.sent} packets sent")
