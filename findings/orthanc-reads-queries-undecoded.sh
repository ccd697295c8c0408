#!/bin/sh
# Guess: a search of DICOMweb (QIDO-RS) finds the same studies whether a character of its query is percent-encoded or not, as URLs
#   mean the same then; so a client may encode every value.
# Seen: the plugin of Orthanc compares the encoded text. For the patient Doe^Jane Mary, PatientName=Doe* finds the study, and
#   Doe%2A, Doe%5EJane* and *Jane%20Mary find nothing; nor do the Patient ID PAT%201 for "PAT 1" and a range of days with %2D. The
#   response is an empty list with status 200. A ? in place of a space finds both.
# Packages: Debian 12: orthanc 1.10.1+dfsg-2+deb12u1, orthanc-dicomweb 1.7+dfsg-6+b2, dcmtk 3.6.7-9~deb12u4. Date: 2026-11-30.
set -eu
t=$(mktemp -d)
trap 'rm -rf "$t"' EXIT
cd "$t"
boost=1.74.0+ds1-21
for name in orthanc=1.10.1+dfsg-2+deb12u1 orthanc-dicomweb=1.7+dfsg-6+b2 dcmtk=3.6.7-9~deb12u4 libdcmtk17=3.6.7-9~deb12u4 \
  libcivetweb1=1.15+dfsg-4 libjsoncpp25=1.9.5-4 liblua5.3-0=5.3.6-2 libpugixml1v5=1.13-0.2 libboost-filesystem1.74.0=$boost \
  libboost-iostreams1.74.0=$boost libboost-locale1.74.0=$boost libboost-regex1.74.0=$boost libboost-thread1.74.0=$boost; do
  apt-get download "$name" >apt.log 2>&1
done
for package in *.deb; do dpkg -x "$package" tree; done
lib=$t/tree/usr/lib/$(uname -m)-linux-gnu
export LD_LIBRARY_PATH="$lib" DCMDICTPATH="$t/tree/usr/share/libdcmtk17/dicom.dic"
cat >study.dump <<'D'
(0008,0016) UI =SecondaryCaptureImageStorage
(0008,0018) UI [1.2.826.0.1.3680043.2.1125.1.3]
(0008,0020) DA [20261130]
(0008,0060) CS [OT]
(0010,0010) PN [Doe^Jane Mary]
(0010,0020) LO [PAT 1]
(0020,000d) UI [1.2.826.0.1.3680043.2.1125.1.1]
(0020,000e) UI [1.2.826.0.1.3680043.2.1125.1.2]
D
tree/usr/bin/dump2dcm --quiet study.dump study.dcm
cat >orthanc.json <<J
{"StorageDirectory": "$t/db", "IndexDirectory": "$t/db", "HttpPort": 8042, "DicomServerEnabled": false,
 "Plugins": ["$(readlink -f tree/usr/share/orthanc/plugins/libOrthancDicomWeb.so)"], "RemoteAccessAllowed": false}
J
cat >ask.py <<'P'
import json, subprocess, sys, time, urllib.request
orthanc = subprocess.Popen(['tree/usr/sbin/Orthanc', 'orthanc.json'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
def ask(target, body=None):
    with urllib.request.urlopen('http://127.0.0.1:8042' + target, body, 20) as response:
        return response.status, json.load(response)
while True:
    try:
        ask('/instances', open('study.dcm', 'rb').read())
        break
    except OSError:
        assert orthanc.poll() is None, 'Orthanc has ended'
        time.sleep(0.2)
for query in sys.argv[1:]:
    status, found = ask('/dicom-web/studies?' + query)
    print(query, status, len(found))
orthanc.terminate()
orthanc.wait()
P
set -- 'PatientName=Doe*' 'PatientName=Doe%2A' 'PatientName=Doe^Jane*' 'PatientName=Doe%5EJane*' 'PatientName=*Jane?Mary' \
  'PatientName=*Jane%20Mary' 'PatientID=PAT?1' 'PatientID=PAT%201' 'StudyDate=20261101-20261130' 'StudyDate=20261101%2D20261130'
unshare --map-root-user --net sh -c 'ip link set lo up && python3 ask.py "$@"' sh "$@" | tee seen
[ "$(awk '{ printf " %s/%s", $2, $3 }' seen)" = ' 200/1 200/0 200/1 200/0 200/1 200/0 200/1 200/0 200/1 200/0' ] || { echo changed; exit 1; }
