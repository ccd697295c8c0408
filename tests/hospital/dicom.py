"""Small DICOM files for tests: a ball in a CT of some slices."""
import math
import struct

CT_IMAGE_STORAGE = "1.2.840.10008.5.1.4.1.1.2"
EXPLICIT_LITTLE_ENDIAN = "1.2.840.10008.1.2.1"
LONG_FORMS = (b"OB", b"OW", b"SQ", b"UN", b"UT")


def element(tag, vr, value):
    if isinstance(value, str):
        value = value.encode()
    if len(value) % 2:
        value += b"\0" if vr in ("UI", "OB") else b" "
    head = struct.pack("<HH", tag >> 16, tag & 0xFFFF) + vr.encode()
    if vr.encode() in LONG_FORMS:
        return head + struct.pack("<HI", 0, len(value)) + value
    return head + struct.pack("<H", len(value)) + value


def file_of(sop_class, sop_instance, elements):
    """A DICOM file of elements {tag: (vr, value)}."""
    meta = (element(0x00020001, "OB", b"\0\1")
            + element(0x00020002, "UI", sop_class)
            + element(0x00020003, "UI", sop_instance)
            + element(0x00020010, "UI", EXPLICIT_LITTLE_ENDIAN))
    data = b"".join(element(tag, *elements[tag]) for tag in sorted(elements))
    length = element(0x00020000, "UL", struct.pack("<I", len(meta)))
    return bytes(128) + b"DICM" + length + meta + data


class Series:
    """A ball of 1000 in air of 0, in `slices` slices of `size` x `size` samples of 2 mm."""

    def __init__(self, uid, slices=12, size=24, patient_id="PAT-4711", name="Muster^Erika",
                 charset=None, description="Head bone", study=None, modality="CT", radius=0.35,
                 series_number=3):
        self.study = study or uid + ".1"
        self.uid = uid + ".2"
        self.patient_id = patient_id
        self.files = {}
        for z in range(slices):
            instance = f"{uid}.3.{z + 1}"
            self.files[instance] = self._slice(instance, z, slices, size, name, charset,
                                               description, modality, radius, uid, series_number)

    @property
    def instances(self):
        return list(self.files)

    def _slice(self, instance, z, slices, size, name, charset, description, modality, radius, uid,
               series_number):
        pixels = bytearray()
        middle = (size - 1) / 2
        for y in range(size):
            for x in range(size):
                far = math.dist((x, y, z), (middle, middle, (slices - 1) / 2))
                pixels += struct.pack("<h", 1000 if far < radius * min(size, slices) else 0)
        elements = {
            0x00080008: ("CS", "ORIGINAL\\PRIMARY\\AXIAL"),
            0x00080016: ("UI", CT_IMAGE_STORAGE), 0x00080018: ("UI", instance),
            0x00080020: ("DA", "20261120"), 0x00080030: ("TM", "101112"),
            0x0008002A: ("DT", "20261120101500"),
            0x00080050: ("SH", "ACC-1"), 0x00080060: ("CS", modality),
            0x00080070: ("LO", "Maker"), 0x00080090: ("PN", "Refer^Red"),
            0x00081010: ("SH", "CT-ROOM-2"), 0x00081030: ("LO", "Head study"),
            0x0008103E: ("LO", description), 0x00081090: ("LO", "Model X"),
            0x00100010: ("PN", name), 0x00100020: ("LO", self.patient_id),
            0x00100021: ("LO", "Hospital"), 0x00100030: ("DA", "19700101"),
            0x00100040: ("CS", "F"), 0x00180050: ("DS", "2"),
            0x00181000: ("LO", "SN-77"), 0x00181020: ("LO", "VB20"),
            0x0020000D: ("UI", self.study), 0x0020000E: ("UI", self.uid),
            0x00200010: ("SH", "S1"), 0x00200011: ("IS", str(series_number)),
            0x00200013: ("IS", str(z + 1)),
            0x00200032: ("DS", f"-20\\-30\\{2 * z}"), 0x00200037: ("DS", "1\\0\\0\\0\\1\\0"),
            0x00200052: ("UI", uid + ".9"), 0x00201040: ("LO", "SN"),
            0x00280002: ("US", struct.pack("<H", 1)), 0x00280004: ("CS", "MONOCHROME2"),
            0x00280010: ("US", struct.pack("<H", size)), 0x00280011: ("US", struct.pack("<H", size)),
            0x00280030: ("DS", "2\\2"), 0x00280100: ("US", struct.pack("<H", 16)),
            0x00280101: ("US", struct.pack("<H", 16)), 0x00280102: ("US", struct.pack("<H", 15)),
            0x00280103: ("US", struct.pack("<H", 1)),
            0x00281052: ("DS", "0"), 0x00281053: ("DS", "1"),
            0x7FE00010: ("OW", bytes(pixels)),
        }
        if charset:
            elements[0x00080005] = ("CS", charset)
        return file_of(CT_IMAGE_STORAGE, instance, elements)
