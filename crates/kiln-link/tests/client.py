"""A client in Python's standard library, written from docs/protocol.md alone.

usage: client.py SOCKET OUT

Greets, wants env/a, takes one whole revision, checks every digest, writes OUT/TARGET/PART, pings, prints the status as JSON.
"""

import hashlib
import json
import os
import socket
import struct
import sys

HELLO, FETCH, WANTS, PING, PONG, STATUS = 1, 2, 4, 5, 6, 7
D_HELLO, D_REVISION, D_CHUNK, D_MISSING, D_PROGRESS, D_PING, D_PONG, D_STATUS = range(65, 73)


class Talk:
    def __init__(self, path):
        self.stream = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.stream.settimeout(20)
        self.stream.connect(path)

    def say(self, kind, payload=b""):
        self.stream.sendall(struct.pack("<IB", 1 + len(payload), kind) + payload)

    def say_json(self, kind, value):
        self.say(kind, json.dumps(value).encode())

    def exactly(self, count):
        parts = []
        while count:
            part = self.stream.recv(min(count, 1 << 20))
            if not part:
                raise SystemExit("the daemon hung up")
            parts.append(part)
            count -= len(part)
        return b"".join(parts)

    def hear(self):
        """The next message that is not a ping."""
        while True:
            (length,) = struct.unpack("<I", self.exactly(4))
            frame = self.exactly(length)
            if frame[0] != D_PING:
                return frame[0], frame[1:]
            self.say(PONG, frame[1:])


def parts_of(table):
    for name, target in table["targets"].items():
        for part in target["parts"]:
            yield name, part


def whole_revision(talk):
    table, contents, arriving = None, {}, {}
    while True:
        kind, payload = talk.hear()
        if kind == D_REVISION:
            table = json.loads(payload)
            wanted = {part["digest"] for _, part in parts_of(table)}
            talk.say_json(FETCH, sorted(wanted - contents.keys() - arriving.keys()))
        elif kind == D_CHUNK:
            digest = payload[:32].hex()
            offset, total = struct.unpack("<QQ", payload[32:48])
            content = arriving.setdefault(digest, bytearray())
            assert offset == len(content), "chunks of a content come in order"
            content += payload[48:]
            if len(content) == total:
                assert hashlib.sha256(content).hexdigest() == digest, "the digest is of the bytes"
                contents[digest] = bytes(arriving.pop(digest))
        elif kind == D_MISSING:
            arriving.pop(json.loads(payload), None)
        else:
            assert kind == D_PROGRESS, kind
        if table and all(part["digest"] in contents for _, part in parts_of(table)):
            return table, contents


def main():
    path, out = sys.argv[1:]
    talk = Talk(path)
    talk.say_json(HELLO, {"protocol": 2, "name": "python", "capabilities": ["revisions"]})
    kind, payload = talk.hear()
    assert kind == D_HELLO and json.loads(payload)["protocol"] == 2
    talk.say_json(WANTS, {"targets": ["env/a"]})
    table, contents = whole_revision(talk)
    for name, part in parts_of(table):
        folder = os.path.join(out, name)
        os.makedirs(folder, exist_ok=True)
        with open(os.path.join(folder, part["name"]), "wb") as file:
            file.write(contents[part["digest"]])
    talk.say(PING, struct.pack("<Q", 41))
    talk.say(STATUS)
    answers = {}
    while len(answers) < 2:
        kind, payload = talk.hear()
        answers[kind] = payload
    assert struct.unpack("<Q", answers[D_PONG]) == (41,)
    print(json.dumps({"status": json.loads(answers[D_STATUS]), "revision": table["number"]}))


if __name__ == "__main__":
    main()
