#!/bin/sh
# Guess: a ZIP entry that is stored, and whose size the caller sets before it writes, has its size and checksum in its local header, and
#   nothing else in it: neither owner nor time were set. So one can compute where its bytes begin, as a USDZ requires (a multiple of 64).
# Seen: libarchive sets bit 3 and writes the checksum 0 in the local header; the checksum follows the data. It adds 20 bytes of extra
#   fields (a time without a time, and an owner of 0), and no option leaves them out: the bytes begin 30 + 10 + 20 behind its beginning.
# Packages: Debian 12: libarchive13 3.6.2-1+deb12u5. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
apt-get download libarchive13=3.6.2-1+deb12u5 >apt.log 2>&1
dpkg -x libarchive13_*.deb tree
cat >write.py <<'P'
import ctypes, glob, struct
lib = ctypes.CDLL(glob.glob('tree/usr/lib/*/libarchive.so.13')[0])
for name in ('archive_write_new', 'archive_entry_new'): getattr(lib, name).restype = ctypes.c_void_p
lib.archive_write_data.restype = ctypes.c_ssize_t
zip_file = ctypes.c_void_p(lib.archive_write_new())
entry = ctypes.c_void_p(lib.archive_entry_new())
assert lib.archive_write_set_format_zip(zip_file) == 0
assert lib.archive_write_set_options(zip_file, b'zip:compression=store,zip:!zip64') == 0
assert lib.archive_write_open_filename(zip_file, b'out.zip') == 0
lib.archive_entry_set_pathname(entry, b'scene.usda')
lib.archive_entry_set_filetype(entry, 0o100000)
lib.archive_entry_set_perm(entry, 0o644)
lib.archive_entry_set_size(entry, ctypes.c_int64(5))
assert lib.archive_write_header(zip_file, entry) == 0
assert lib.archive_write_data(zip_file, b'hello', ctypes.c_size_t(5)) == 5
assert lib.archive_write_close(zip_file) == 0
data = open('out.zip', 'rb').read()
signature, _, flags, method, _, _, checksum, packed, size, name, extra = struct.unpack('<IHHHHHIIIHH', data[:30])
assert signature == 0x04034b50 and method == 0 and size == packed == 5
print(f'bit 3 {flags >> 3 & 1}, checksum {checksum}, extra fields {extra} bytes, data at {data.index(b"hello")}')
P
seen=$(python3 write.py)
echo "$seen"
[ "$seen" = 'bit 3 1, checksum 0, extra fields 20 bytes, data at 60' ] || { echo "changed: $seen"; exit 1; }
