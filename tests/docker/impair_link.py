"""Delays and drops packets that leave a network namespace, where the kernel has no netem to do it.

    nsenter --target PID --net python3 impair_link.py SECONDS DELAY_S LOSS

Packets go to a netfilter queue, and their verdicts come late; some are to be dropped. What TCP makes of
that is TCP's own doing, as on a real link. Ends by itself, and packets then go straight again.
"""

import heapq
import select
import shutil
import socket
import struct
import subprocess
import sys
import time
from random import Random

NETLINK_NETFILTER = 12
QUEUE_NUMBER = 7

SUBSYSTEM_QUEUE = 3 << 8
PACKET, VERDICT, CONFIG = SUBSYSTEM_QUEUE, SUBSYSTEM_QUEUE | 1, SUBSYSTEM_QUEUE | 2
REQUEST, ACKNOWLEDGE = 1, 4
COMMAND, PARAMETERS, LONGEST = 1, 2, 3
"""Attributes of a configuration."""
BIND = struct.pack(">BxH", 1, 0)
META_ONLY = struct.pack(">IB", 0, 1)
PACKET_HEADER, VERDICT_HEADER = 1, 2
DROP, ACCEPT = 0, 1

RULE = ("OUTPUT", "--protocol", "tcp", "--jump", "NFQUEUE", "--queue-num", str(QUEUE_NUMBER))


def attribute(kind: int, value: bytes) -> bytes:
    """A netlink attribute, padded to four bytes."""
    return struct.pack("=HH", 4 + len(value), kind) + value + bytes(-len(value) % 4)


def message(kind: int, flags: int, attributes: bytes) -> bytes:
    """A message to the queue."""
    body = struct.pack(">BBH", 0, 0, QUEUE_NUMBER) + attributes
    return struct.pack("=IHHII", 16 + len(body), kind, flags, 0, 0) + body


def packet_numbers(data: bytes) -> list[int]:
    """Numbers of the packets in what the kernel sent."""
    numbers = []
    while len(data) >= 16:
        length, kind = struct.unpack_from("=IH", data)
        rest = data[20:length]
        while kind == PACKET and len(rest) >= 4:
            size, name = struct.unpack_from("=HH", rest)
            if name == PACKET_HEADER:
                numbers.append(struct.unpack_from(">I", rest, 4)[0])
            rest = rest[(size + 3) & ~3 :]
        data = data[(length + 3) & ~3 :]
    return numbers


def impair(queue: socket.socket, seconds: float, delay_s: float, loss: float) -> tuple[int, int]:
    """Hold every packet for a while, and drop some; how many passed and how many did not."""
    random, due, counts = Random(1), [], [0, 0]
    ends = time.monotonic() + seconds
    while (now := time.monotonic()) < ends or due:
        while due and due[0][0] <= now:
            _, number, verdict = heapq.heappop(due)
            counts[verdict] += 1
            header = attribute(VERDICT_HEADER, struct.pack(">II", verdict, number))
            queue.send(message(VERDICT, REQUEST, header))
        wait = max(min(due[0][0] if due else ends, ends + delay_s) - now, 0.0)
        if select.select([queue], [], [], wait)[0]:
            # Those that come after the end pass at once, so that there is one.
            impaired = now < ends
            for number in packet_numbers(queue.recv(65536)):
                verdict = DROP if impaired and random.random() < loss else ACCEPT
                heapq.heappush(due, (now + delay_s * impaired, number, verdict))
    return counts[ACCEPT], counts[DROP]


def main() -> None:
    seconds, delay_s, loss = (float(text) for text in sys.argv[1:])
    iptables = shutil.which("iptables", path="/usr/sbin:/sbin:/usr/bin") or "iptables"
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_NETFILTER) as queue:
        queue.bind((0, 0))
        for kind, value in (
            (COMMAND, BIND),
            (PARAMETERS, META_ONLY),
            (LONGEST, struct.pack(">I", 10_000)),
        ):
            queue.send(message(CONFIG, REQUEST | ACKNOWLEDGE, attribute(kind, value)))
            error = struct.unpack_from("=i", queue.recv(4096), 16)[0]
            if error:
                sys.exit(f"the kernel has no netfilter queue: error {-error}")
        subprocess.run([iptables, "--append", *RULE], check=True)
        try:
            passed, dropped = impair(queue, seconds, delay_s, loss)
        finally:
            subprocess.run([iptables, "--delete", *RULE], check=True)
    sys.stdout.write(f"{passed} packets passed, {dropped} did not\n")


if __name__ == "__main__":
    main()
