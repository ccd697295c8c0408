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


ENCAPSULATED = "1.2.840.10008.1.2.1.98"


def encapsulated(file):
    """A file of one frame that `file_of` made, with its samples in a fragment, not compressed."""
    at = file.index(struct.pack("<HH", 0x7FE0, 0x0010) + b"OW")
    samples = file[at + 12:]
    item = struct.pack("<HHI", 0xFFFE, 0xE000, len(samples)) + samples
    pixels = (file[at:at + 4] + b"OB" + struct.pack("<HI", 0, 0xFFFFFFFF)
              + struct.pack("<HHI", 0xFFFE, 0xE000, 0) + item
              + struct.pack("<HHI", 0xFFFE, 0xE0DD, 0))
    return file[:at] + pixels


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


SEGMENTATION_STORAGE = "1.2.840.10008.5.1.4.1.1.66.4"


def sequence(*items):
    """The value of a sequence, of items {tag: (vr, value)}."""
    value = b""
    for item in items:
        data = b"".join(element(tag, *item[tag]) for tag in sorted(item))
        value += struct.pack("<HHI", 0xFFFE, 0xE000, len(data)) + data
    return value


def code(value, scheme, meaning):
    return sequence({0x00080100: ("SH", value), 0x00080102: ("SH", scheme),
                     0x00080104: ("LO", meaning)})


SKULL = {"label": "Skull", "category": ("91723000", "SCT", "Anatomical Structure"),
         "type": ("89546000", "SCT", "Skull"), "region": ("69536005", "SCT", "Head")}
LESION = {"label": "Lesion", "category": ("49755003", "SCT", "Morphologically Abnormal Structure"),
          "type": ("52988006", "SCT", "Lesion"), "region": ("12738006", "SCT", "Brain")}


def segmentation(series, segments=(SKULL, LESION), slices=8, size=16):
    """The UIDs of a series and its only object, and that: a binary segmentation in the study of a
    series, of boxes beside each other, a frame for each slice of each."""
    uid = series.uid[:-2] + ".77"
    instance = uid + ".1"
    bits = bytearray()
    frames = []
    width = size // len(segments)
    for number in range(len(segments)):
        for z in range(slices):
            frames.append({
                0x00209111: ("SQ", sequence({0x00209157: ("UL", struct.pack("<II", number + 1,
                                                                            z + 1))})),
                0x00209113: ("SQ", sequence({0x00200032: ("DS", f"-20\\-30\\{2 * z}")})),
                0x0062000A: ("SQ", sequence({0x0062000B: ("US", struct.pack("<H", number + 1))}))})
            bits += bytes(1 if 2 <= y < size - 2 and 1 <= x - number * width < width - 1
                          and 2 <= z < slices - 2 else 0
                          for y in range(size) for x in range(size))
    pixels = bytes(sum(bits[at + bit] << bit for bit in range(8)) for at in range(0, len(bits), 8))
    described = [{
        0x00620003: ("SQ", code(*segment["category"])),
        0x00620004: ("US", struct.pack("<H", number + 1)), 0x00620005: ("LO", segment["label"]),
        0x00620008: ("CS", "MANUAL"), 0x0062000F: ("SQ", code(*segment["type"])),
        0x00082218: ("SQ", code(*segment["region"]))} for number, segment in enumerate(segments)]
    shared = {
        0x00209116: ("SQ", sequence({0x00200037: ("DS", "1\\0\\0\\0\\1\\0")})),
        0x00289110: ("SQ", sequence({0x00180050: ("DS", "2"), 0x00180088: ("DS", "2"),
                                     0x00280030: ("DS", "2\\2")}))}
    return uid, instance, file_of(SEGMENTATION_STORAGE, instance, {
        0x00080008: ("CS", "DERIVED\\PRIMARY"), 0x00080016: ("UI", SEGMENTATION_STORAGE),
        0x00080018: ("UI", instance), 0x00080020: ("DA", "20261120"),
        0x00080023: ("DA", "20261120"), 0x00080030: ("TM", "101112"),
        0x00080033: ("TM", "111213"), 0x00080050: ("SH", "ACC-1"), 0x00080060: ("CS", "SEG"),
        0x00081115: ("SQ", sequence({
            0x0008114A: ("SQ", sequence(*({0x00081150: ("UI", CT_IMAGE_STORAGE),
                                           0x00081155: ("UI", each)} for each in series.files))),
            0x0020000E: ("UI", series.uid)})),
        0x00080070: ("LO", "Maker"), 0x00080090: ("PN", "Refer^Red"),
        0x00081030: ("LO", "Head study"), 0x0008103E: ("LO", "Segments"),
        0x00081090: ("LO", "Model X"), 0x00100010: ("PN", "Muster^Erika"),
        0x00100020: ("LO", series.patient_id), 0x00100021: ("LO", "Hospital"),
        0x00100030: ("DA", "19700101"), 0x00100040: ("CS", "F"), 0x00181000: ("LO", "SN-77"),
        0x00181020: ("LO", "VB20"), 0x0020000D: ("UI", series.study), 0x0020000E: ("UI", uid),
        0x00200010: ("SH", "S1"), 0x00200011: ("IS", "77"), 0x00200013: ("IS", "1"),
        0x00200052: ("UI", uid + ".9"), 0x00201040: ("LO", "SN"),
        0x00209221: ("SQ", sequence({0x00209164: ("UI", uid + ".8")})),
        0x00209222: ("SQ", sequence(
            {0x00209164: ("UI", uid + ".8"),
             0x00209165: ("AT", struct.pack("<HH", 0x0062, 0x000B)),
             0x00209167: ("AT", struct.pack("<HH", 0x0062, 0x000A))},
            {0x00209164: ("UI", uid + ".8"),
             0x00209165: ("AT", struct.pack("<HH", 0x0020, 0x0032)),
             0x00209167: ("AT", struct.pack("<HH", 0x0020, 0x9113))})),
        0x00280002: ("US", struct.pack("<H", 1)), 0x00280004: ("CS", "MONOCHROME2"),
        0x00280008: ("IS", str(len(frames))), 0x00280010: ("US", struct.pack("<H", size)),
        0x00280011: ("US", struct.pack("<H", size)), 0x00280100: ("US", struct.pack("<H", 1)),
        0x00280101: ("US", struct.pack("<H", 1)), 0x00280102: ("US", struct.pack("<H", 0)),
        0x00280103: ("US", struct.pack("<H", 0)), 0x00282110: ("CS", "00"),
        0x00620001: ("CS", "BINARY"), 0x00620002: ("SQ", sequence(*described)),
        0x00700080: ("CS", "SEGMENTS"), 0x00700081: ("LO", "Segments"),
        0x00700084: ("PN", "Maker"), 0x52009229: ("SQ", sequence(shared)),
        0x52009230: ("SQ", sequence(*frames)), 0x7FE00010: ("OB", pixels)})
