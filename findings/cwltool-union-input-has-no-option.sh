#!/bin/sh
# Guess: cwltool makes an option of each input of a tool, so an input that may be a file or a folder (`type: [File, Directory]`) is given
#   by its name, as one that is a file: `cwltool tool.cwl --source head.nii.gz`. Its help says so for the file.
# Seen: there is no such option, and --help does not name the input, although the tool is valid and cannot run without it. It is the same
#   for `[string, int]`. A file of inputs (job.json) is the only way.
# Packages: Debian 12: cwltool 3.1.20230209161050-1, with the libraries that this machine lacks, of any version. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
pinned=cwltool=3.1.20230209161050-1
others=$(apt-get install --simulate --no-install-recommends $pinned | sed -n 's/^Inst \([^ ]*\) .*/\1/p')
for name in $others; do [ "$name" = cwltool ] || pinned="$pinned $name"; done
apt-get download $pinned >apt.log 2>&1
for package in *.deb; do dpkg -x "$package" tree; done
export PYTHONPATH="$t/tree/usr/lib/python3/dist-packages"
cwltool="/usr/bin/python3 $t/tree/usr/bin/cwltool"
echo sample >a.txt
seen=
for type in '"File"' '["File", "Directory"]' '["string", "int"]'; do
  cat >tool.cwl <<C
{"cwlVersion": "v1.2", "class": "CommandLineTool", "baseCommand": ["echo"], "stdout": "out.txt", "outputs": {"out": {"type": "stdout"}},
 "inputs": {"source": {"type": $type, "inputBinding": {"position": 1}}}}
C
  $cwltool --validate tool.cwl >log 2>&1
  named=$($cwltool tool.cwl --help 2>/dev/null | grep -c -e --source || true)
  $cwltool --no-container tool.cwl --source a.txt >log 2>&1 && ran=yes || ran=no
  without=$($cwltool --no-container tool.cwl 2>&1 | grep -c 'Missing required input' || true)
  [ "$named" -eq 0 ] && told=no || told=yes
  echo "$type: the help names it: $told; runs with --source: $ran; required: $without"
  seen="$seen|$told $ran $without"
done
cat >job.json <<'J'
{"source": {"class": "File", "path": "a.txt"}}
J
sed 's/"type": \["string", "int"\]/"type": ["File", "Directory"]/' tool.cwl >either.cwl
$cwltool --no-container either.cwl job.json >log 2>&1 && by_file=yes || by_file=no
echo "a file or a folder, by a file of inputs: $by_file"
[ "$seen|$by_file" = "|yes yes 0|no no 1|no no 1|yes" ] || { echo "changed"; exit 1; }
