#!/bin/sh
# Guess: `cjxl -d 0`, which its help calls mathematically lossless, keeps all values of a grey image of 12 bits, the usual depth of
#   medical images. `jxlinfo` says of the result: "(possibly) lossless, 12-bit Grayscale".
# Seen: of a PGM whose largest value is 4095, 257 different values are left. The samples were taken for shares of 65535 and
#   then stored with 12 bits, so the lowest four are rounded away; djxl stretches them again, up to 4097, above the declared
#   largest value. Nothing is reported. The same image with values up to 65535 is kept exactly.
# Packages: Debian 12: libjxl-tools and libjxl0.7 0.7.0-10+deb12u1. Date: 2026-11-28.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
for name in libjxl-tools=0.7.0-10+deb12u1 libjxl0.7=0.7.0-10+deb12u1 \
    libopenexr-3-1-30=3.1.5-5 libimath-3-1-29=3.1.6-1 libbrotli1=1.0.9-2+deb12u1 libgif7=5.2.1-2.5+deb12u1 libhwy1=1.0.3-3+deb12u1 \
    libjpeg62-turbo=1:2.1.5-2 liblcms2-2=2.14-2+deb12u1 libpng16-16=1.6.39-2+deb12u6; do
  apt-get download "$name" >apt.log 2>&1
done
for package in *.deb; do dpkg -x "$package" tree; done
export LD_LIBRARY_PATH="$t/tree/usr/lib/$(uname -m)-linux-gnu"
cat >images.py <<'P'
import struct, sys
def write(name, largest, step):
    values = [at * step for at in range(4096)]
    with open(name, 'wb') as file:
        file.write(b'P5\n64 64\n%d\n' % largest + struct.pack('>4096H', *values))
def read(name):
    kind, size, largest, samples = open(name, 'rb').read().split(b'\n', 3)
    return int(largest), struct.unpack('>4096H', samples)
if sys.argv[1] == 'write':
    write('12.pgm', 4095, 1)
    write('16.pgm', 65535, 16)
else:
    seen = []
    for name in '12', '16':
        (largest, before), (_, after) = read(name + '.pgm'), read(name + '-out.pgm')
        print('%s bits: %d of 4096 samples changed, %d different values left, up to %d of %d' % (
            name, sum(a != b for a, b in zip(before, after)), len(set(after)), max(after), largest))
        seen.append(len(set(after)))
    if not (250 <= seen[0] <= 260 and seen[1] == 4096):
        sys.exit('This differs from what was seen.')
P
python3 images.py write
for bits in 12 16; do
  tree/usr/bin/cjxl -d 0 $bits.pgm $bits.jxl >cjxl.log 2>&1
  tree/usr/bin/djxl $bits.jxl $bits-out.pgm >djxl.log 2>&1
done
python3 images.py compare
