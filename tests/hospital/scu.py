"""A user of C-STORE that may do what no other would: PS3.7 and PS3.8, as far as tests need them."""
import socket
import struct

import dicom

IMPLICIT = "1.2.840.10008.1.2"


def item(kind, data):
    return struct.pack(">BxH", kind, len(data)) + data


def element(group, number, value):
    """Of a command, which is in implicit little endian."""
    return struct.pack("<HHI", group, number, len(value)) + value


def pdu(kind, body):
    return struct.pack(">BxI", kind, len(body)) + body


def associate_request(called="BONE", calling="CT1", syntax=dicom.EXPLICIT_LITTLE_ENDIAN):
    context = b"\1\0\0\0" + item(0x30, dicom.CT_IMAGE_STORAGE.encode())
    context += item(0x40, syntax.encode())
    user = item(0x51, struct.pack(">I", 16384)) + item(0x52, b"1.2.3.4")
    body = struct.pack(">HH16s16s32x", 1, 0, called.ljust(16).encode(), calling.ljust(16).encode())
    body += item(0x10, b"1.2.840.10008.3.1.1.1") + item(0x20, context) + item(0x50, user)
    return pdu(1, body)


def context_is_accepted(response):
    """True if the content of an A-ASSOCIATE-AC accepts its only presentation context."""
    at = 68
    while at < len(response):
        kind, length = struct.unpack(">BxH", response[at:at + 4])
        if kind == 0x21:
            return response[at + 6] == 0
        at += 4 + length
    return False


class Scu:
    def __init__(self, port, called="BONE", calling="CT1", syntax=dicom.EXPLICIT_LITTLE_ENDIAN):
        self.connection = socket.create_connection(("127.0.0.1", port), timeout=60)
        self.connection.sendall(associate_request(called, calling, syntax))
        kind, response = self.receive()
        self.accepted = kind == 2
        self.has_context = self.accepted and context_is_accepted(response)

    def send(self, kind, body):
        self.connection.sendall(pdu(kind, body))

    def receive(self):
        """The kind of the next PDU, and its content; (None, b"") when the connection has ended."""
        head = self.read(6)
        if len(head) < 6:
            return None, b""
        kind, length = struct.unpack(">BxI", head)
        return kind, self.read(length)

    def read(self, length):
        data = b""
        while len(data) < length:
            try:
                piece = self.connection.recv(length - len(data))
            except ConnectionError:
                piece = b""
            if not piece:
                return data
            data += piece
        return data

    def command(self, instance):
        """The request to store an object of that name."""
        def uid(text):
            return (text + "\0" * (len(text) % 2)).encode()
        body = element(0, 2, uid(dicom.CT_IMAGE_STORAGE))
        body += element(0, 0x100, struct.pack("<H", 1)) + element(0, 0x110, struct.pack("<H", 7))
        body += element(0, 0x700, struct.pack("<H", 0)) + element(0, 0x800, struct.pack("<H", 1))
        body += element(0, 0x1000, uid(instance))
        body = element(0, 0, struct.pack("<I", len(body))) + body
        self.values(3, body)

    def values(self, control, data):
        """One P-DATA: 3 is the whole command, 0 a part of the data set, 2 its last one."""
        self.send(4, struct.pack(">IBB", len(data) + 2, 1, control) + data)

    def data_set(self, file):
        """The data set of a DICOM file."""
        length = struct.unpack("<I", file[140:144])[0]
        return file[144 + length:]

    def status(self):
        """Of the response; None when there is none."""
        kind, body = self.receive()
        if kind != 4:
            return None
        at = body.index(b"\0\0\0\x09\2\0\0\0")
        return struct.unpack("<H", body[at + 8:at + 10])[0]

    def store(self, instance, file):
        self.command(instance)
        self.values(2, self.data_set(file))
        return self.status()

    def release(self):
        self.send(5, bytes(4))
        kind, _ = self.receive()
        self.connection.close()
        return kind == 6

    def abort(self):
        self.send(7, bytes(4))
        self.connection.close()
