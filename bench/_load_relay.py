"""The floor under an agent in Python: receives a datagram, sends one. Usage: _load_relay.py PORT

Every datagram goes back to its sender, until one says ``PEER``: from then on they go to that one's sender.
"""

import socket
import sys

PEER = b"PEER"


def main(port: int) -> None:
    """Runs until killed."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    sock.bind(("127.0.0.1", port))
    while True:
        data, sender = sock.recvfrom(65536)
        if data == PEER:
            peer = sender
            break
        sock.sendto(data, sender)
    while True:
        data = sock.recv(65536)
        sock.sendto(data, peer)


if __name__ == "__main__":
    main(int(sys.argv[1]))
